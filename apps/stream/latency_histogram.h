#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace supertac {

/// Quantiles of any number of durations in fixed memory: 64 classes for every doubling from 1 us to 71
/// minutes, so a quantile is right to 1.6 %.
class LatencyHistogram {
 public:
  void add(double seconds);
  std::uint64_t count() const { return count_; }
  /// The value that a share `q` of the durations does not exceed, in seconds; 0 without any.
  double quantile(double q) const;
  double max() const { return max_; }

 private:
  static constexpr std::size_t kPerDoubling = 64, kDoublings = 32;
  std::array<std::uint64_t, kPerDoubling * kDoublings> classes_{};
  std::uint64_t count_ = 0;
  double max_ = 0;
};

}  // namespace supertac
