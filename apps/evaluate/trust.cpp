#include "apps/evaluate/trust.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "data/scores/metrics.h"
#include "data/windows/transforms/signal_features.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr double kGoodSsim = 0.8, kSure = 0.8, kNearMm = 15, kFarMm = 30;

double mean_of(std::span<const float> values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

}  // namespace

void TrustScores::add(const Drawn& drawn) {
  const std::uint32_t window = drawn.example;
  const std::span<const float> output = drawn.pictures[0], truth = drawn.target,
                               predicted_error = drawn.predicted_error;
  if (model_.novelty) {
    ++judged_;
    unlike_ += model_.novelty->unlike_training(signal_features(drawn.input, windows_.array())) ? 1 : 0;
  }
  if (predicted_error.empty()) return;
  const std::size_t pass = windows_.pass_of(window);
  coverage_.add(pass, output, truth, predicted_error);
  if (!windows_.contact(window)) return;
  const double y = windows_.position(window).y_mm;
  if (pass != in_contact_of_) in_contact_of_ = pass, begin_mm_ = y;
  const ImageGrid grid = windows_.image();
  contact_.push_back({expected_ssim_loss(output, predicted_error, grid), mean_of(predicted_error),
                      ssim(output, truth, grid.height, grid.width), std::abs(y - begin_mm_)});
}

// The chance that of two windows, one good and one bad, the bad one is doubted more (Mann-Whitney).
double TrustScores::auroc() const {
  std::vector<Window> order = contact_;
  std::ranges::sort(order, {}, &Window::doubt);
  double bad_above = 0, good = 0, bad = 0;
  for (const Window& w : order) {
    if (w.ssim >= kGoodSsim) {
      ++good;
    } else {
      ++bad;
      bad_above += good;
    }
  }
  return good > 0 && bad > 0 ? bad_above / (good * bad) : Metrics::kNone;
}

double TrustScores::ssim_of_surest(double share) const {
  std::vector<Window> order = contact_;
  std::ranges::sort(order, {}, &Window::doubt);
  order.resize(static_cast<std::size_t>(std::ceil(share * static_cast<double>(order.size()))));
  double sum = 0;
  for (const Window& w : order) sum += w.ssim;
  return order.empty() ? Metrics::kNone : sum / static_cast<double>(order.size());
}

double TrustScores::width(double from_mm, double to_mm) const {
  double sum = 0, count = 0;
  for (const Window& w : contact_)
    if (w.slid_mm >= from_mm && w.slid_mm < to_mm) sum += w.predicted_error, ++count;
  return count > 0 ? sum / count : Metrics::kNone;
}

std::vector<std::string> TrustScores::lines() const {
  std::vector<std::string> lines;
  const auto percent = [](double share) { return format(100 * share, 1) + " %"; };
  if (!coverage_.empty())
    lines.push_back("intervals hold " + percent(coverage_.of(model_.interval_factor())) +
                    " of the pixels (factor " + format(model_.interval_factor(), 2) + "; " +
                    format(coverage_.factor(), 2) + " would hold " + percent(IntervalCoverage::kCovered) +
                    ")");
  if (!contact_.empty())
    lines.push_back(
        "in contact, the surest " + percent(kSure) + " have SSIM " + format(ssim_of_surest(kSure), 3) +
        (std::isfinite(auroc()) ? "; predicted errors tell SSIM below 0.8 with AUROC " + format(auroc(), 3)
                                : "; none, or every one, has SSIM below 0.8"));
  if (judged_ > 0)
    lines.push_back(percent(static_cast<double>(unlike_) / static_cast<double>(judged_)) +
                    " of the windows are unlike training");
  return lines;
}

nlohmann::ordered_json TrustScores::to_json() const {
  const auto number = [](double v) { return std::isfinite(v) ? nlohmann::ordered_json(v) : nullptr; };
  nlohmann::ordered_json json;
  if (!coverage_.empty()) {
    json["factor"] = model_.interval_factor();
    json["coverage"] = coverage_.of(model_.interval_factor());
    json["factor_found"] = coverage_.factor();
    json["sure_ssim"] = number(ssim_of_surest(kSure));
    json["auroc"] = number(auroc());
    json["predicted_error_near"] = number(width(0, kNearMm));
    json["predicted_error_far"] = number(width(kFarMm, 1e9));
  }
  if (judged_ > 0) json["unlike_training"] = static_cast<double>(unlike_) / static_cast<double>(judged_);
  return json;
}

}  // namespace supertac
