// The pages, and pictures and figures as they take them.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>

namespace supertac {

// Each page is one piece of HTML that needs nothing from elsewhere, put together from frame.html and its like
// when the program is built (CMakeLists.txt, embed.cmake).

std::string_view live_page();
std::string_view collect_page();
/// GET /link.js of both: how they hear of their program.
std::string_view link_script();
/// Of results: what result_page() puts its data into.
std::string_view report_page_frame();

/// A page of results that needs nothing from elsewhere: pages/report.js draws it of `data`, which has "title"
/// and the "log" of a training (CSV), or the "result" of an evaluation with what evaluation_page() adds.
std::string result_page(const nlohmann::ordered_json& data);

/// RFC 4648, with padding.
std::string base64(std::span<const std::uint8_t> bytes);
/// base64() of the levels 0..255 that colour_of() chooses its colours by.
std::string levels_base64(std::span<const float> values);
/// base64() of the colour map, [256][3].
std::string colour_map_base64();
/// One line of JSON in ASCII; what is no UTF-8 is replaced.
std::string dumped(const nlohmann::json& json);

}  // namespace supertac
