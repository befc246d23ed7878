// Pictures and figures as a page takes them.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>

namespace supertac {

/// RFC 4648, with padding.
std::string base64(std::span<const std::uint8_t> bytes);
/// base64() of the levels 0..255 that colour_of() chooses its colours by.
std::string levels_base64(std::span<const float> values);
/// base64() of the colour map, [256][3].
std::string colour_map_base64();
/// One line of JSON in ASCII; what is no UTF-8 is replaced.
std::string dumped(const nlohmann::json& json);

}  // namespace supertac
