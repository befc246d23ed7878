// How near pictures come to their truths: each picture's scores, and their means over a set of windows.
// Images are [height][width], row-major. SSIM and PSNR take a range of 1; values beyond it count as they are.
#pragma once

#include <array>
#include <complex>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <vector>

#include "data/plates/truth.h"
#include "data/sensors/taxel_array.h"

struct kiss_fft_state;

namespace supertac {

/// PSNR values are capped here: an error of 60 dB (0.1 % of the range) is what rounding to 8 bits costs, so
/// two images above it are the same picture. Without a cap identical images have an infinite PSNR, and flat
/// ones decide every mean.
constexpr double kPsnrCapDb = 60;

/// Mean squared error over all pixels. Throws std::invalid_argument when the sizes differ or are 0.
double mean_squared_error(std::span<const float> a, std::span<const float> b);

/// 10 log10(1 / mse), at most kPsnrCapDb (also for mse = 0).
double psnr_db(double mse);

/// Structural similarity after Wang et al. 2004, mean over the valid positions of the window:
///   (2 ma mb + C1)(2 sab + C2) / ((ma^2 + mb^2 + C1)(sa^2 + sb^2 + C2)),  C1 = (0.01)^2, C2 = (0.03)^2
///   (range 1)
/// Window: Gaussian 11x11, sigma 1.5; for images below 11x11 (on which the Gaussian has no valid position)
/// uniform, 7x7 or the largest odd size that fits. Weights add up to 1; variances and covariance are centred
/// sums w (a - ma)(b - mb), never E[ab] - E[a]E[b], which can come out negative. The Gaussian is used when
/// both sides have 11 pixels or more. Throws std::invalid_argument when a side is below 3 or a, b do not hold
/// height * width pixels.
double ssim(std::span<const float> a, std::span<const float> b, std::size_t height, std::size_t width);

/// How far one image is displaced against another, and how well their structure agrees.
struct PhaseCorrelation {
  bool defined = false;  ///< false when an image is flat: it has no phase; the other fields are 0 then
  double peak = 0;       ///< highest value of the correlation surface, 1 for a perfect match
  double dx_px = 0;      ///< displacement of the first image against the second along the columns (x)
  double dy_px = 0;      ///< the same along the rows (y), in [-height/2, height/2)
};

/// Phase correlation (Kuglin and Hines 1975) of two images a, b of one size:
///   A = FFT2(w (a - mean a)), B = FFT2(w (b - mean b)), w[r,c] = h[r] h[c], h[i] = (1 - cos(2 pi i/(S-1))) /
///   2 along a side of S pixels, R = A conj(B),  surface(e) = IFFT2(R / (|R| + e max|R|))
/// peak is the maximum of surface(kPeakEpsilon). The displacement is the place of the maximum of
/// surface(kShiftEpsilon), refined by a parabola through it and its two neighbours along each axis: bins
/// far below the strongest hold rounding and noise and are not asked where the image lies. A larger epsilon
/// would pull displacements towards 0 (the Hann window stands still): at 0.1 by up to a third, at 0.001 by
/// less than a tenth. Without the Hann window two identical ridge images score 1/16: a ridge varies along one
/// axis only, so all other columns of the spectrum are 0/0. With it they score about 0.93. The value ignores
/// amplitude, unrelated images score about 0.2, and periodic textures alias modulo their pitch.
class PhaseCorrelator {
 public:
  static constexpr double kPeakEpsilon = 1e-12;
  static constexpr double kShiftEpsilon = 1e-3;
  static constexpr double kFlat =
      1e-6;  ///< an image is flat when no pixel is further than this from the mean

  /// Throws std::invalid_argument when a side is below 4.
  PhaseCorrelator(int height, int width);

  /// `a`, `b`  [height][width]. Throws std::invalid_argument on another number of pixels.
  PhaseCorrelation operator()(std::span<const float> a, std::span<const float> b) const;

 private:
  using Plan = std::unique_ptr<kiss_fft_state, decltype(&std::free)>;
  struct Plans {  // one way
    Plans(int height, int width, bool inverse);
    Plan of_rows{nullptr, &std::free}, of_columns{nullptr, &std::free};
  };
  using Spectrum = std::vector<std::complex<float>>;  // [height][width]

  Spectrum transformed(const Spectrum& image, const Plans& plans) const;
  Spectrum spectrum_of(std::span<const float> image) const;
  std::vector<float> surface_of(const Spectrum& a, const Spectrum& b, double epsilon) const;

  int height_, width_;
  Plans forward_, inverse_;
  std::vector<float> down_, across_;  // Hann windows of both axes
};

/// Scores of one output against its truth.
struct ImageScores {
  double mse = 0, ssim = 0;
  bool has_position = false;     ///< the truth is not flat, so that it lies somewhere
  double phase_correlation = 0;  ///< 0 when the output is flat
  double position_error_px = 0;  ///< length of the displacement; half the shorter side when the output
                                 ///< is flat
  double position_error_mm = 0;  ///< likewise, where pixels need not be square
};

/// What is reported about a set of windows. Figures over no windows at all are NaN (null in JSON).
struct Metrics {
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  std::uint64_t windows = 0;
  double psnr_mean_db = kNone;    ///< mean over the windows of each image's PSNR
  double psnr_pooled_db = kNone;  ///< PSNR of the mean of all squared errors
  double ssim = kNone;            ///< mean over the windows
  // About windows whose truth is not flat: a flat truth has no position.
  double phase_correlation = kNone;        ///< mean peak
  double phase_correlation_floor = kNone;  ///< the same with outputs and truths of different windows paired
  double position_error_px = kNone;        ///< mean length of the sub-pixel displacement
  double position_error_mm = kNone;
  double ghost_rate = kNone;  ///< where the truth is flat: share of pictures with a pixel beyond +-kGhost
  double miss_rate =
      kNone;  ///< where the truth goes beyond +-kFelt: share of pictures that stay within +-kGhost

  static constexpr float kGhost = 0.2F, kFelt = 0.5F;
};

/// Keys are the member names, in their order.
nlohmann::ordered_json to_json(const Metrics& metrics);

/// Takes images one by one and gives the Metrics of all of them. For the floor it keeps a random sample of
/// kFloorPairs windows (reservoir sampling with its own fixed seed: same windows in the same order, same
/// bits) and pairs each output with the truth of another window.
class MetricsAccumulator {
 public:
  static constexpr std::size_t kFloorPairs = 256;

  explicit MetricsAccumulator(const ImageGrid& grid);
  /// A truth that stays within `silent` of 0 shows nothing.
  void add(std::span<const float> output, std::span<const float> truth, const ImageScores& scores,
           float silent = 0);
  Metrics result() const;

 private:
  void sample(std::span<const float> output, std::span<const float> truth);
  double floor() const;

  ImageGrid grid_;
  // By what a figure is a mean of: all windows, those with a position, those of silent truths and of felt
  // ones.
  std::array<std::uint64_t, 4> counts_{};
  Metrics sums_;  // of the mean squared errors where the pooled PSNR stands
  std::vector<float> sampled_outputs_, sampled_truths_;  // up to kFloorPairs images each
};

/// All windows, and apart those in contact, on flat truth and in the air: a flat truth is easy and would
/// flatter the mean. Windows near a texture count among all only. One object serves one thread.
class ZoneMetrics {
 public:
  /// Throws std::invalid_argument when a side is below 4.
  explicit ZoneMetrics(const ImageGrid& grid);
  /// `contact_level`: of a measured truth (WindowSet::contact_level()); what is in contact and goes beyond it
  /// in the outermost pixels counts as edge() as well, and what stays within it shows nothing. Throws
  /// std::invalid_argument when a size is wrong or a value of the output is not finite.
  void add(std::span<const float> output, std::span<const float> truth, Zone zone,
           std::optional<float> contact_level = {});
  Metrics all() const { return parts_[kAll].result(); }
  Metrics contact() const { return parts_[kContact].result(); }
  /// {"all": {...}, "contact": {...}, "flat": {...}, "air": {...}}, of measured truths "edge" besides
  nlohmann::ordered_json to_json() const;

 private:
  enum Part { kAll, kContact, kFlat, kAir, kEdge, kParts };
  ImageScores scores_of(std::span<const float> output, std::span<const float> truth) const;
  bool on_edge(std::span<const float> truth, float level) const;

  ImageGrid grid_;
  PhaseCorrelator correlator_;
  std::vector<MetricsAccumulator> parts_;  // [kParts]
};

}  // namespace supertac
