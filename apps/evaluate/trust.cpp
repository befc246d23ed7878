#include "apps/evaluate/trust.h"

#include <cmath>

#include "data/windows/transforms/signal_features.h"
#include "io/numbers/numbers.h"

namespace supertac {

void TrustScores::add(const Drawn& drawn) {
  const std::span<const float> predicted_error = drawn.predicted_error;
  if (model_.novelty) {
    ++judged_;
    unlike_ += model_.novelty->unlike_training(signal_features(drawn.input, windows_.array())) ? 1 : 0;
  }
  if (!predicted_error.empty())
    coverage_.add(windows_.pass_of(drawn.example), drawn.pictures[0], drawn.target, predicted_error);
}

std::vector<std::pair<std::string, IntervalCoverage::Held>> TrustScores::classes() const {
  constexpr const char* kHeights[] = {"true 0", "true to 0.2", "true to 0.5", "true above 0.5"};
  std::vector<std::pair<std::string, IntervalCoverage::Held>> classes;
  for (std::size_t h = 0; h < IntervalCoverage::kHeights; ++h)
    classes.emplace_back(kHeights[h], coverage_.of_height(h));
  for (std::size_t level = 0; level < IntervalFactors::kLevels; ++level)
    classes.emplace_back(level < IntervalFactors::kEdges.size()
                             ? "drawn below " + format(IntervalFactors::kEdges[level], 2)
                             : "drawn above " + format(IntervalFactors::kEdges.back(), 2),
                         coverage_.of_level(level));
  std::erase_if(classes, [](const auto& one) { return one.second.pixels == 0; });
  return classes;
}

std::vector<std::string> TrustScores::lines() const {
  std::vector<std::string> lines;
  const auto percent = [](double share) { return format(100 * share, 1) + " %"; };
  if (!coverage_.empty())
    lines.push_back("intervals hold " + percent(coverage_.share()) + " of the pixels (factors " +
                    model_.interval_factors().text() + "; " + coverage_.factors().text() + " would hold " +
                    percent(IntervalCoverage::kCovered) + ")");
  std::string truths;
  for (const auto& [name, held] : classes())
    if (name.starts_with("true"))
      truths += (truths.empty() ? "" : ", ") + name.substr(5) + " " + percent(held.share) + " (+-" +
                format(held.half_width, 2) + ")";
  if (!truths.empty()) lines.push_back("intervals hold by height of the truth: " + truths);
  if (judged_ > 0)
    lines.push_back(percent(static_cast<double>(unlike_) / static_cast<double>(judged_)) +
                    " of the windows are unlike training");
  return lines;
}

nlohmann::ordered_json TrustScores::to_json() const {
  const auto number = [](double v) { return std::isfinite(v) ? nlohmann::ordered_json(v) : nullptr; };
  nlohmann::ordered_json json;
  if (!coverage_.empty()) {
    json["factor"] = model_.interval_factors().text();
    json["coverage"] = coverage_.share();
    json["factor_found"] = coverage_.factors().text();
    for (const auto& [name, held] : classes())
      json["coverage_of"][name] = {
          {"share", number(held.share)}, {"half_width", number(held.half_width)}, {"pixels", held.pixels}};
  }
  if (judged_ > 0) json["unlike_training"] = static_cast<double>(unlike_) / static_cast<double>(judged_);
  return json;
}

}  // namespace supertac
