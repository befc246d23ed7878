#include "data/scores/phase_correlation.h"

#include <kissfft/kiss_fft.h>
#include <kissfft/kiss_fftr.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <new>
#include <stdexcept>
#include <string>

#include "io/numbers/same_bits.h"

namespace supertac {
namespace {

static_assert(sizeof(kiss_fft_cpx) == 2 * sizeof(float), "kissfft must be its single-precision build");

kiss_fft_cpx* complex(std::vector<float>& numbers, std::size_t at = 0) {
  return reinterpret_cast<kiss_fft_cpx*>(&numbers[2 * at]);
}
const kiss_fft_cpx* complex(const std::vector<float>& numbers, std::size_t at = 0) {
  return reinterpret_cast<const kiss_fft_cpx*>(&numbers[2 * at]);
}

std::vector<float> hann(int size) {
  std::vector<float> window;
  for (int i = 0; i < size; ++i)
    window.push_back(static_cast<float>(0.5 - 0.5 * same_bits::cosine(i / (size - 1.0))));
  return window;
}

// Offset in (-1/2, 1/2) of the top of the parabola through (-1, before), (0, top), (1, after).
double parabola_top(double before, double top, double after) {
  const double curvature = before - 2 * top + after;
  return curvature < 0 ? 0.5 * (before - after) / curvature : 0.0;
}

}  // namespace

void PhaseCorrelator::Free::operator()(void* plan) const { std::free(plan); }

// One axis after the other: kissfft's own plan for two axes asks for too little memory at most sizes and then
// gives none.
PhaseCorrelator::Plans::Plans(int height, int width, bool inverse) {
  if (height < 4 || width < 4 || height % 2 != 0 || width % 2 != 0)
    throw std::invalid_argument("phase correlation: sides must be even and at least 4, got " +
                                std::to_string(height) + "x" + std::to_string(width));
  along_rows.reset(kiss_fftr_alloc(width, inverse ? 1 : 0, nullptr, nullptr));
  along_columns.reset(kiss_fft_alloc(height, inverse ? 1 : 0, nullptr, nullptr));
  if (!along_rows || !along_columns) throw std::bad_alloc();
}

PhaseCorrelator::PhaseCorrelator(int height, int width)
    : height_(height), width_(width), forward_(height, width, false), inverse_(height, width, true) {
  down_ = hann(height);
  across_ = hann(width);
  surface_.resize(down_.size() * across_.size());
  const auto bins = static_cast<std::size_t>(height) * static_cast<std::size_t>(width / 2 + 1);
  for (Spectrum* spectrum : {&a_, &b_, &cross_, &turned_}) spectrum->resize(2 * bins);
  row_.resize(2 * bins / down_.size());
  column_.resize(2 * down_.size());
}

void PhaseCorrelator::to_spectrum(Spectrum& out) {
  const std::size_t height = down_.size(), bins = row_.size() / 2;
  for (std::size_t r = 0; r < height; ++r) {
    kiss_fftr(forward_.along_rows.get(), &surface_[r * across_.size()], complex(row_));
    for (std::size_t c = 0; c < bins; ++c) *complex(turned_, c * height + r) = *complex(row_, c);
  }
  for (std::size_t c = 0; c < bins; ++c) {
    kiss_fft(forward_.along_columns.get(), complex(turned_, c * height), complex(column_));
    for (std::size_t r = 0; r < height; ++r) *complex(out, r * bins + c) = *complex(column_, r);
  }
}

void PhaseCorrelator::to_surface(const Spectrum& spectrum) {
  const std::size_t height = down_.size(), bins = row_.size() / 2;
  for (std::size_t c = 0; c < bins; ++c) {
    for (std::size_t r = 0; r < height; ++r) *complex(column_, r) = *complex(spectrum, r * bins + c);
    kiss_fft(inverse_.along_columns.get(), complex(column_), complex(turned_, c * height));
  }
  for (std::size_t r = 0; r < height; ++r) {
    for (std::size_t c = 0; c < bins; ++c) *complex(row_, c) = *complex(turned_, c * height + r);
    kiss_fftri(inverse_.along_rows.get(), complex(row_), &surface_[r * across_.size()]);
  }
}

// False when the image is flat.
bool PhaseCorrelator::transform(std::span<const float> image, Spectrum& out) {
  if (image.size() != surface_.size())
    throw std::invalid_argument("phase correlation: expects " + std::to_string(surface_.size()) +
                                " pixels, got " + std::to_string(image.size()));
  double mean = 0;
  for (const float v : image) mean += v;
  mean /= static_cast<double>(image.size());
  double deviation = 0;
  for (std::size_t i = 0; i < image.size(); ++i) {
    const double centred = image[i] - mean;
    deviation = std::max(deviation, std::abs(centred));
    surface_[i] = static_cast<float>(centred) * down_[i / across_.size()] * across_[i % across_.size()];
  }
  to_spectrum(out);
  return deviation > kFlat;
}

// surface_ = IFFT2(R / (|R| + epsilon max|R|))
void PhaseCorrelator::correlate(double epsilon) {
  double strongest = 0;
  for (std::size_t i = 0; i < a_.size(); i += 2)
    strongest = std::max<double>(strongest, std::hypot(a_[i], a_[i + 1]) * std::hypot(b_[i], b_[i + 1]));
  const double pixels = static_cast<double>(surface_.size());
  for (std::size_t i = 0; i < a_.size(); i += 2) {
    const double ar = a_[i], ai = a_[i + 1], br = b_[i], bi = b_[i + 1];
    const double re = ar * br + ai * bi, im = ai * br - ar * bi;
    const double scale = 1 / ((std::hypot(re, im) + epsilon * strongest) * pixels);
    cross_[i] = static_cast<float>(re * scale);
    cross_[i + 1] = static_cast<float>(im * scale);
  }
  to_surface(cross_);
}

PhaseCorrelation PhaseCorrelator::operator()(std::span<const float> a, std::span<const float> b) {
  const bool a_varies = transform(a, a_), b_varies = transform(b, b_);
  if (!a_varies || !b_varies) return {};
  PhaseCorrelation result{.defined = true};
  correlate(kPeakEpsilon);
  result.peak = *std::max_element(surface_.begin(), surface_.end());

  correlate(kShiftEpsilon);
  const int top = static_cast<int>(std::max_element(surface_.begin(), surface_.end()) - surface_.begin());
  const int row = top / width_, column = top % width_;
  const auto at = [&](int r, int c) {
    return surface_[static_cast<std::size_t>((r + height_) % height_ * width_ + (c + width_) % width_)];
  };
  const double dy = row + parabola_top(at(row - 1, column), at(row, column), at(row + 1, column));
  const double dx = column + parabola_top(at(row, column - 1), at(row, column), at(row, column + 1));
  result.dy_px = dy < height_ / 2.0 ? dy : dy - height_;
  result.dx_px = dx < width_ / 2.0 ? dx : dx - width_;
  return result;
}

}  // namespace supertac
