#include "apps/stream/latency_histogram.h"

#include <algorithm>
#include <cmath>

namespace supertac {

void LatencyHistogram::add(double seconds) {
  int exponent = 0;
  const double mantissa = std::frexp(std::max(seconds * 1e6, 1.0), &exponent);  // [0.5, 1)
  const auto part = static_cast<std::size_t>((2 * mantissa - 1) * kPerDoubling);
  const std::size_t index = static_cast<std::size_t>(exponent - 1) * kPerDoubling + part;
  ++classes_[std::min(index, classes_.size() - 1)];
  ++count_;
  max_ = std::max(max_, seconds);
}

double LatencyHistogram::quantile(double q) const {
  const auto wanted = static_cast<std::uint64_t>(std::ceil(q * static_cast<double>(count_)));
  std::uint64_t seen = 0;
  for (std::size_t i = 0; i + 1 < classes_.size(); ++i) {
    seen += classes_[i];
    if (classes_[i] == 0 || seen < wanted) continue;
    const double upper = 1 + static_cast<double>(i % kPerDoubling + 1) / kPerDoubling;
    return std::min(max_, 1e-6 * std::ldexp(upper, static_cast<int>(i / kPerDoubling)));
  }
  return max_;
}

}  // namespace supertac
