#pragma once

#include <cstdint>
#include <string>

namespace supertac {

/// Spreads the bits of a counter or key over 64 bits (finalizer of SplitMix64, Steele et al. 2014). Not for
/// secrets.
inline std::uint64_t mix64(std::uint64_t z) {
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31);
}

constexpr std::uint64_t kGolden64 =
    0x9e3779b97f4a7c15ULL;  ///< odd step that keeps counters apart before mix64

/// 16 lower-case hexadecimal digits.
inline std::string hex64(std::uint64_t value) {
  std::string text(16, '0');
  for (std::size_t i = 0; i < 16; ++i) text[i] = "0123456789abcdef"[(value >> (60 - 4 * i)) & 15];
  return text;
}

}  // namespace supertac
