#include "apps/evaluate/trust.h"

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

std::vector<std::string> TrustScores::lines() const {
  std::vector<std::string> lines;
  const auto percent = [](double share) { return format(100 * share, 1) + " %"; };
  if (!coverage_.empty())
    lines.push_back("intervals hold " + percent(coverage_.of(model_.interval_factor())) +
                    " of the pixels (factor " + format(model_.interval_factor(), 2) + "; " +
                    format(coverage_.factor(), 2) + " would hold " + percent(IntervalCoverage::kCovered) +
                    ")");
  if (judged_ > 0)
    lines.push_back(percent(static_cast<double>(unlike_) / static_cast<double>(judged_)) +
                    " of the windows are unlike training");
  return lines;
}

nlohmann::ordered_json TrustScores::to_json() const {
  nlohmann::ordered_json json;
  if (!coverage_.empty()) {
    json["factor"] = model_.interval_factor();
    json["coverage"] = coverage_.of(model_.interval_factor());
    json["factor_found"] = coverage_.factor();
  }
  if (judged_ > 0) json["unlike_training"] = static_cast<double>(unlike_) / static_cast<double>(judged_);
  return json;
}

}  // namespace supertac
