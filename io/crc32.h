// CRC-32 of ISO 3309 (the one of zlib, PNG and Ethernet): polynomial 0xEDB88320, reflected.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace supertac {

/// crc32("123456789") == 0xCBF43926. A long input may be given in parts, each with the sum of the parts
/// before it as `seed`: crc32(b, crc32(a)) == crc32(a followed by b).
std::uint32_t crc32(std::span<const std::byte> bytes, std::uint32_t seed = 0);

}  // namespace supertac
