#include "io/numbers/hash.h"

#include <zlib.h>

namespace supertac {

std::string hex_digits(std::uint64_t value, std::size_t digits) {
  std::string text(digits, '0');
  for (; digits-- > 0; value >>= 4) text[digits] = "0123456789abcdef"[value & 15];
  return text;
}

std::uint64_t stream_of(std::string_view name) {
  std::uint64_t hash = 1469598103934665603ULL;
  for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ULL;
  return hash;
}

std::uint32_t crc32(std::span<const std::byte> bytes, std::uint32_t seed) {
  if (bytes.empty()) return seed;  // zlib would begin anew
  return static_cast<std::uint32_t>(
      ::crc32_z(seed, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

}  // namespace supertac
