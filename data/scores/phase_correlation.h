// By how much two images are displaced against each other.
#pragma once

#include <complex>
#include <memory>
#include <span>
#include <vector>

struct kiss_fft_state;

namespace supertac {

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
/// would pull displacements towards 0 (the Hann window stands still): at .1 by up to a third, at .001 by less
/// than a tenth. Without the Hann window two identical ridge images score 1/16: a ridge varies along one axis
/// only, so all other columns of the spectrum are 0/0. With it they score about .93. The value ignores
/// amplitude, unrelated images score about .2, and periodic textures alias modulo their pitch. One object
/// serves one thread: the transforms share its buffers.
class PhaseCorrelator {
 public:
  static constexpr double kPeakEpsilon = 1e-12;
  static constexpr double kShiftEpsilon = 1e-3;
  static constexpr double kFlat =
      1e-6;  ///< an image is flat when no pixel is further than this from the mean

  /// Throws std::invalid_argument when a side is below 4.
  PhaseCorrelator(int height, int width);

  /// `a`, `b`  [height][width]. Throws std::invalid_argument on another number of pixels.
  PhaseCorrelation operator()(std::span<const float> a, std::span<const float> b);

 private:
  struct Free {
    void operator()(void* plan) const;
  };
  using Plan = std::unique_ptr<kiss_fft_state, Free>;
  struct Plans {  // one way
    Plans(int height, int width, bool inverse);
    Plan of_rows, of_columns;
  };
  using Spectrum = std::vector<std::complex<float>>;  // [height][width]

  Spectrum transformed(const Spectrum& image, const Plans& plans) const;
  Spectrum spectrum_of(std::span<const float> image) const;
  void correlate(const Spectrum& a, const Spectrum& b, double epsilon);

  int height_, width_;
  Plans forward_, inverse_;
  std::vector<float> down_, across_;  // Hann windows of both axes
  std::vector<float> surface_;        // [height][width]
};

}  // namespace supertac
