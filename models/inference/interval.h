// What a predicted error means for a pixel.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace supertac {

/// Smaller predicted errors count as this one, 2.5 of the 255 steps of an 8-bit picture.
inline constexpr float kLeastPredictedError = 0.01F;
inline float at_least(float predicted_error) { return std::max(predicted_error, kLeastPredictedError); }

/// Half the width of the interval that holds the truth of nine pixels in ten, in units of the predicted
/// error: the largest of those found (1.1 to 1.45) on 6_Ridges and 4_Ridges, each left out of the training
/// (trial 1, one seed each).
inline constexpr double kIntervalFactor = 1.45;

/// The half widths of pixels whose predicted errors are these.
std::vector<float> half_widths(double factor, std::span<const float> predicted_error);

/// How many pixels' truths lie within picture +- factor * at_least(predicted error). Passes are the unit,
/// each counts the same: windows of one pass are not exchangeable (Dunn, Wasserman, Ramdas 2018).
class IntervalCoverage {
 public:
  static constexpr double kCovered = 0.9;

  /// One picture, all three [pixels]; windows of a pass come one behind the other.
  void add(std::size_t pass, std::span<const float> picture, std::span<const float> truth,
           std::span<const float> predicted_error);
  bool empty() const { return passes_.empty(); }
  /// The share of pixels, 0 to 1, in steps of 0.05 of the factor; farther than 20 is never within. Not to be
  /// asked when empty().
  double of(double factor) const;
  /// The least factor that covers kCovered of the pixels; 20 where none does.
  double factor() const;

 private:
  static constexpr std::size_t kBins = 400;  // of |error| / predicted error below 20
  static constexpr double kBinsPerUnit = 20;
  struct Pass {
    std::size_t number;
    std::array<std::uint64_t, kBins> ratios{};
    std::uint64_t pixels = 0;
  };
  std::vector<Pass> passes_;
};

}  // namespace supertac
