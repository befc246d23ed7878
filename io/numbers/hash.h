// Hashes that tell contents apart (fingerprints, random streams), a checksum against damage, and one against
// forgery.
#pragma once

#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace supertac {

/// Spreads the bits of a counter or key over 64 bits (finalizer of SplitMix64, Steele et al. 2014). Not for
/// secrets.
constexpr std::uint64_t mix64(std::uint64_t z) {
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31);
}

constexpr std::uint64_t kGolden64 =
    0x9e3779b97f4a7c15ULL;  ///< odd step that keeps counters apart before mix64

/// The last `digits` hexadecimal digits of a number, in lower case.
std::string hex_digits(std::uint64_t value, std::size_t digits);

/// Words one after the other: state = mix64(state * kGolden64 + word). Fingerprints in checkpoints are made
/// of it.
class Hash {
 public:
  explicit Hash(std::uint64_t state = 1) : state_(state) {}
  void add(std::integral auto word) { state_ = mix64(state_ * kGolden64 + static_cast<std::uint64_t>(word)); }
  void add(float value) { add(std::bit_cast<std::uint32_t>(value)); }
  void add(std::string_view text) {
    add(text.size());
    for (const char c : text) add(static_cast<unsigned char>(c));
  }
  std::uint64_t value() const { return state_; }
  /// 16 lower-case hexadecimal digits.
  std::string hex() const { return hex_digits(value(), 16); }

 private:
  std::uint64_t state_;
};

/// The random stream of a text of any length: FNV-1a with an offset of its own, which simulated recordings
/// need to stay the same. Of a short name stream_named() (random.h).
std::uint64_t stream_hashed(std::string_view name);

/// CRC-32 of ISO 3309 (the one of zlib, PNG and Ethernet), by zlib. A long input may be given in parts, each
/// with the sum of the parts before it as `seed`: crc32(b, crc32(a)) == crc32(a followed by b).
std::uint32_t crc32(std::span<const std::byte> bytes, std::uint32_t seed = 0);

/// SHA-256 (FIPS 180-4): names a content so that nobody can forge another one of that name.
class Sha256 {
 public:
  void add(std::span<const std::byte> bytes);
  void add(std::string_view text) { add(std::as_bytes(std::span(text))); }
  /// 64 lower-case hexadecimal digits, of what was added so far.
  std::string hex() const;

 private:
  void block(const std::byte* bytes);

  std::array<std::uint32_t, 8> state_{0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
                                      0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
  std::array<std::byte, 64> waiting_{};
  std::uint64_t length_ = 0;
};

std::string sha256(std::string_view text);

}  // namespace supertac
