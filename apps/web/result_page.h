#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace supertac {

/// A page of results that needs nothing from elsewhere: pages/report.js draws it of `data`, which has "title"
/// and the "log" of a training (CSV), or the "result" of an evaluation with what EvaluationPage adds.
std::string result_page(const nlohmann::ordered_json& data);

}  // namespace supertac
