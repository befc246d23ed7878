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

#include "models/networks/supertac_model.h"

namespace supertac {

/// Smaller predicted errors count as this one, 2.5 of the 255 steps of an 8-bit picture.
inline constexpr float kLeastPredictedError = 0.01F;
inline float floored(float predicted_error) { return std::max(predicted_error, kLeastPredictedError); }

/// The interval that holds the truth of nine pixels in ten, v +- w. A picture may stand a little beside the
/// surface, and be wrong besides; a network can predict the latter only:
///   w = shift max |v' - v| + factor floored(predicted error), 1 at most,    v': the eight pixels around
/// the first term being, to first order, what a picture `shift` pixels off changes. A predicted error is the
/// network's, or where `load` is not 0 that of with_load().
struct PixelInterval {
  /// By default the least shift (in steps of 1/4) and then the least factor (of 0.05) that hold 90 % in each
  /// class of truths of IntervalCoverage on passes held out of trial 1: four plates, preset paper, split
  /// pass, seeds 0 and 1 (docs/map.md).
  double shift = 0.75, factor = 0.55, load = 0;

  /// Of pictures [height][width] and as many predicted errors, which may be `widths` itself; no heap once
  /// that is large. Empty where `predicted_error` is. NaN for pixels that are NaN, which count as no
  /// neighbours.
  void half_widths(std::span<const float> picture, std::int64_t width, std::span<const float> predicted_error,
                   std::vector<float>& widths) const;
  /// A taxel tells the mean of what lies under it, so a pixel there may be up to scale^2 times as high; a
  /// network that has never felt such an object does not know this of itself. Into `errors`, no heap once
  /// that is large: the predicted errors [rows scale][columns scale] of `input`, plus of each pixel `load`
  /// times the signal of its taxel, the mean of its channels in the last frame.
  void with_load(const NetworkFormat& format, std::span<const float> input,
                 std::span<const float> predicted_error, std::vector<float>& errors) const;
  /// w of one pixel, before it is cut at 1.
  float reach(std::span<const float> picture, std::int64_t width, std::size_t pixel,
              float predicted_error) const;

  /// "0.75,0.55", with a load "0.75,0.55,16", or "1.45" for a factor without a shift, as older files have it;
  /// back from it, or nothing for another text, a shift outside 0 to 10, a factor outside 0.05 to 100 or a
  /// load outside 0 to 4096.
  std::string text() const;
  static std::optional<PixelInterval> read(const std::string& text);
  bool operator==(const PixelInterval&) const = default;
};

/// How many pixels' truths lie within picture +- half width, by how high the truth is: most pixels are empty,
/// so a share of all is a figure about emptiness. In share() and found() passes are the unit, each counts the
/// same: windows of one pass are not exchangeable (Dunn, Wasserman, Ramdas 2018). of_height() is over pixels.
class IntervalCoverage {
 public:
  static constexpr double kCovered = 0.9;
  /// Truths are told apart by their height: 0, at most 0.2, at most 0.5, above.
  static constexpr std::size_t kHeights = 4;
  static constexpr std::array<float, kHeights - 1> kEdges = {0, 0.2F, 0.5F};
  struct Held {
    double share = 0, half_width = 0, pixels = 0;  ///< within; mean; how many
  };

  /// `format`: of the network, for a load.
  explicit IntervalCoverage(const PixelInterval& judged = {}, const NetworkFormat& format = {})
      : judged_(judged), format_(format) {}
  /// One picture, its truth and predicted error [height][width], and the input that it was drawn from, which
  /// a load asks for; windows of a pass come one behind the other.
  void add(std::size_t pass, std::span<const float> picture, std::int64_t width, std::span<const float> truth,
           std::span<const float> predicted_error, std::span<const float> input = {});
  const PixelInterval& judged() const { return judged_; }
  bool empty() const { return passes_.empty(); }
  // Not to be asked when empty():
  double share() const;  ///< of all pixels, mean over passes
  Held of_height(std::size_t height) const;
  /// With the judged shift the least factor that holds kCovered in each height, in steps of 0.05; 20 where
  /// none does (Mondrian conformal prediction with the largest class for all; Vovk, Gammerman, Shafer 2005,
  /// ch. 4.5).
  PixelInterval found() const;
  double half_width() const;  ///< mean over all pixels

 private:
  static constexpr std::size_t kBins = 400;  // of (|error| - shift term) / predicted error below 20
  static constexpr double kBinsPerUnit = 20;
  struct Height {
    std::array<std::uint32_t, kBins> ratios{};
    std::uint64_t pixels = 0, within = 0;
    double half_width = 0;
  };
  struct Pass {
    std::size_t number;
    std::array<Height, kHeights> heights{};
  };

  PixelInterval judged_;
  NetworkFormat format_;
  std::vector<Pass> passes_;
  std::vector<float> errors_;
};

}  // namespace supertac
