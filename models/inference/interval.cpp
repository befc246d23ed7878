#include "models/inference/interval.h"

#include <cmath>
#include <numeric>

namespace supertac {

std::vector<float> half_widths(double factor, std::span<const float> predicted_error) {
  std::vector<float> widths;
  for (const float predicted : predicted_error)
    widths.push_back(static_cast<float>(factor) * at_least(predicted));
  return widths;
}

void IntervalCoverage::add(std::size_t pass, std::span<const float> picture, std::span<const float> truth,
                           std::span<const float> predicted_error) {
  if (passes_.empty() || passes_.back().number != pass) passes_.push_back({.number = pass});
  Pass& counts = passes_.back();
  for (std::size_t i = 0; i < picture.size(); ++i) {
    const double ratio =
        std::abs(double{picture[i]} - double{truth[i]}) / double{at_least(predicted_error[i])};
    const double bin = ratio * kBinsPerUnit;
    if (bin < double{kBins}) ++counts.ratios[static_cast<std::size_t>(bin)];
  }
  counts.pixels += picture.size();
}

double IntervalCoverage::of(double factor) const {
  const auto bins = static_cast<std::ptrdiff_t>(std::min(double{kBins}, factor * kBinsPerUnit));
  double sum = 0;
  for (const Pass& pass : passes_) {
    const auto begin = pass.ratios.begin();
    sum += static_cast<double>(std::accumulate(begin, begin + bins, std::uint64_t{0})) /
           static_cast<double>(pass.pixels);
  }
  return sum / static_cast<double>(passes_.size());
}

double IntervalCoverage::factor() const {
  for (std::size_t bins = 1; bins < kBins; ++bins)
    if (of(static_cast<double>(bins) / kBinsPerUnit) >= kCovered)
      return static_cast<double>(bins) / kBinsPerUnit;
  return static_cast<double>(kBins) / kBinsPerUnit;
}

}  // namespace supertac
