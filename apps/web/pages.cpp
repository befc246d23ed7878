#include "apps/web/pages.h"

#include <vector>

#include "io/images/images.h"

namespace supertac {

std::string base64(std::span<const std::uint8_t> bytes) {
  constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t word = 0;
    for (std::size_t k = 0; k < 3; ++k) word = word << 8 | (k < count ? bytes[i + k] : 0U);
    for (std::size_t k = 0; k < 4; ++k) text += k > count ? '=' : kDigits[word >> (18 - 6 * k) & 63];
  }
  return text;
}

std::string levels_base64(std::span<const float> values) {
  std::vector<std::uint8_t> levels;
  levels.reserve(values.size());
  for (const float value : values) levels.push_back(level_of(value));
  return base64(levels);
}

std::string colour_map_base64() {
  std::vector<std::uint8_t> map;
  for (int i = 0; i < 256; ++i)
    for (const std::uint8_t part : colour_of(static_cast<float>(i) / 255)) map.push_back(part);
  return base64(map);
}

std::string dumped(const nlohmann::json& json) {
  return json.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
}

std::string result_page(const nlohmann::ordered_json& data) {
  std::string text = data.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
  for (std::size_t at = 0; (at = text.find('<', at)) != std::string::npos;) text.replace(at, 1, "\\u003c");
  constexpr std::string_view kMark = "<!--data-->";
  std::string page(report_page_frame());
  return page.replace(page.find(kMark), kMark.size(), text);
}

}  // namespace supertac
