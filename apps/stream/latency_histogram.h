#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace supertac {

/// Quantiles of any number of durations in fixed memory: 64 classes for every doubling from 1 us to 71
/// minutes, so a quantile is right to 1.1 %.
class LatencyHistogram {
 public:
  void add(double seconds) {
    const double place = kPerDoubling * std::log2(std::max(1e6 * seconds, 1.0));
    ++classes_[static_cast<std::size_t>(std::min(place, classes_.size() - 1.0))];
    ++count_;
    max_ = std::max(max_, seconds);
  }
  std::uint64_t count() const { return count_; }
  /// The value that a share `q` of the durations does not exceed, in seconds; 0 without any.
  double quantile(double q) const {
    const auto wanted = static_cast<std::uint64_t>(std::ceil(q * static_cast<double>(count_)));
    std::uint64_t seen = 0;
    for (std::size_t i = 0; i + 1 < classes_.size(); ++i) {
      seen += classes_[i];
      if (classes_[i] > 0 && seen >= wanted)
        return std::min(max_, 1e-6 * std::exp2((static_cast<double>(i) + 1) / kPerDoubling));
    }
    return max_;
  }
  double max() const { return max_; }

 private:
  static constexpr int kPerDoubling = 64, kDoublings = 32;
  std::array<std::uint64_t, kPerDoubling * kDoublings> classes_{};
  std::uint64_t count_ = 0;
  double max_ = 0;
};

}  // namespace supertac
