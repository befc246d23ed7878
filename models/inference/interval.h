// What a predicted error means for a pixel.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace supertac {

/// Smaller predicted errors count as this one, 2.5 of the 255 steps of an 8-bit picture.
inline constexpr float kLeastPredictedError = 0.01F;
inline float at_least(float predicted_error) { return std::max(predicted_error, kLeastPredictedError); }

/// Half the width of the interval that holds the truth of nine pixels in ten, in units of at_least(predicted
/// error), for each level of the picture: |picture| below 0.02, 0.05, 0.2, 0.5, and above. Most pixels are
/// empty, so one factor for all would be a figure about emptiness and hold a quarter of what is pressed.
/// Found by level, the intervals hold nine in ten of each (Mondrian conformal prediction; Vovk, Gammerman,
/// Shafer 2005, ch. 4.5).
struct IntervalFactors {
  static constexpr std::size_t kLevels = 5;
  static constexpr std::array<float, kLevels - 1> kEdges = {0.02F, 0.05F, 0.2F, 0.5F};

  /// By default the larger ones of those found on passes held out of trial 1 (four plates, preset paper,
  /// split pass, seeds 0 and 1).
  std::array<double, kLevels> of_level = {0.7, 2.45, 2.95, 2.6, 3.45};

  static std::size_t level_of(float picture);
  float half_width(float picture, float predicted_error) const {
    return static_cast<float>(of_level[level_of(picture)]) * at_least(predicted_error);
  }
  /// Of each pixel, as many as predicted_error has, which may be `widths` itself; no heap once it is large.
  void half_widths(std::span<const float> picture, std::span<const float> predicted_error,
                   std::vector<float>& widths) const;

  /// "1.45", which holds for every level, or "0.7,2.45,2.95,2.6,3.45"; back from it, or nothing for another
  /// text or a factor outside 0.05 to 100.
  std::string text() const;
  static std::optional<IntervalFactors> read(const std::string& text);
  bool operator==(const IntervalFactors&) const = default;
};

/// How many pixels' truths lie within picture +- half width, by what is there and by what was drawn.
/// Passes are the unit, each counts the same: windows of one pass are not exchangeable (Dunn, Wasserman,
/// Ramdas 2018).
class IntervalCoverage {
 public:
  static constexpr double kCovered = 0.9;
  /// Truths are told apart by their height: 0, at most 0.2, at most 0.5, above.
  static constexpr std::size_t kHeights = 4;
  struct Held {
    double share = 0, half_width = 0, pixels = 0;  ///< within; mean; how many
  };

  explicit IntervalCoverage(const IntervalFactors& judged = {}) : judged_(judged) {}
  /// One picture, all three [pixels]; windows of a pass come one behind the other.
  void add(std::size_t pass, std::span<const float> picture, std::span<const float> truth,
           std::span<const float> predicted_error);
  bool empty() const { return passes_.empty(); }
  // Not to be asked when empty():
  double share() const;  ///< of all pixels, mean over passes
  Held of_height(std::size_t height) const { return heights_[height].mean(); }
  Held of_level(std::size_t level) const { return levels_[level].mean(); }
  /// The least factors that cover kCovered of the pixels of each level, in steps of 0.05; 20 where none does.
  /// A level without a pixel has the factor of its neighbour nearer to the middle.
  IntervalFactors factors() const;

 private:
  static constexpr std::size_t kBins = 400;  // of |error| / predicted error below 20
  static constexpr double kBinsPerUnit = 20;
  struct Pass {
    std::size_t number;
    std::array<std::array<std::uint32_t, kBins>, IntervalFactors::kLevels> ratios{};
    std::array<std::uint64_t, IntervalFactors::kLevels> pixels{};
    std::uint64_t within = 0;
  };
  struct Sum {
    double within = 0, half_width = 0, pixels = 0;
    Held mean() const { return {within / pixels, half_width / pixels, pixels}; }
  };
  std::optional<double> factor_of(std::size_t level) const;

  IntervalFactors judged_;
  std::vector<Pass> passes_;
  std::array<Sum, kHeights> heights_{};
  std::array<Sum, IntervalFactors::kLevels> levels_{};
};

}  // namespace supertac
