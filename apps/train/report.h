#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace supertac {

struct LogLine;

/// One HTML page with the learning curves, on linear and logarithmic axes, the other curves and the settings
/// of a run; it loads nothing from elsewhere.
std::string report_page(const nlohmann::ordered_json& settings, const std::vector<LogLine>& lines);

}  // namespace supertac
