#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace supertac {

struct LogLine;

/// One HTML page with the settings and the curves of a run as SVG; it loads nothing from elsewhere.
std::string report_page(const nlohmann::ordered_json& settings, const std::vector<LogLine>& lines);

}  // namespace supertac
