// By how much two images are displaced against each other.

#include <kissfft/kiss_fft.h>

#include <algorithm>
#include <cmath>
#include <new>
#include <stdexcept>
#include <string>

#include "data/scores/metrics.h"
#include "io/numbers/same_bits.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

static_assert(sizeof(kiss_fft_cpx) == sizeof(std::complex<float>),
              "kissfft must be its single-precision build");

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

PhaseCorrelator::Plans::Plans(int height, int width, bool inverse) {
  if (height < 4 || width < 4)
    throw std::invalid_argument(refusal("phase correlation", "sides", "4 pixels or more",
                                        std::to_string(height) + "x" + std::to_string(width)));
  of_rows.reset(kiss_fft_alloc(width, inverse ? 1 : 0, nullptr, nullptr));
  of_columns.reset(kiss_fft_alloc(height, inverse ? 1 : 0, nullptr, nullptr));
  if (!of_rows || !of_columns) throw std::bad_alloc();
}

PhaseCorrelator::PhaseCorrelator(int height, int width)
    : height_(height),
      width_(width),
      forward_(height, width, false),
      inverse_(height, width, true),
      down_(hann(height)),
      across_(hann(width)) {}

// One axis after the other: kissfft's own plan for two axes asks for too little memory at most sizes and then
// gives none.
PhaseCorrelator::Spectrum PhaseCorrelator::transformed(const Spectrum& image, const Plans& plans) const {
  const auto along = [](const Spectrum& from, std::size_t size, kiss_fft_state* plan) {
    const std::size_t lines = from.size() / size;
    Spectrum turned(from.size()), line(size);  // [size][lines]
    for (std::size_t i = 0; i < lines; ++i) {
      kiss_fft(plan, reinterpret_cast<const kiss_fft_cpx*>(&from[i * size]),
               reinterpret_cast<kiss_fft_cpx*>(line.data()));
      for (std::size_t k = 0; k < size; ++k) turned[k * lines + i] = line[k];
    }
    return turned;
  };
  return along(along(image, across_.size(), plans.of_rows.get()), down_.size(), plans.of_columns.get());
}

// Empty when the image is flat.
PhaseCorrelator::Spectrum PhaseCorrelator::spectrum_of(std::span<const float> image) const {
  expect_values("phase correlation", "image", down_.size() * across_.size(), image.size());
  double mean = 0;
  for (const float v : image) mean += v;
  mean /= static_cast<double>(image.size());
  double deviation = 0;
  Spectrum windowed(image.size());
  for (std::size_t i = 0; i < image.size(); ++i) {
    const double centred = image[i] - mean;
    deviation = std::max(deviation, std::abs(centred));
    windowed[i] = static_cast<float>(centred) * down_[i / across_.size()] * across_[i % across_.size()];
  }
  return deviation > kFlat ? transformed(windowed, forward_) : Spectrum();
}

// IFFT2(R / (|R| + epsilon max|R|)), [height][width]
std::vector<float> PhaseCorrelator::surface_of(const Spectrum& a, const Spectrum& b, double epsilon) const {
  std::vector<std::complex<double>> products;
  double strongest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    products.push_back(std::complex<double>(a[i]) * std::conj(std::complex<double>(b[i])));
    strongest = std::max(strongest, std::abs(products.back()));
  }
  Spectrum cross;
  for (const std::complex<double>& r : products)
    cross.emplace_back(r / ((std::abs(r) + epsilon * strongest) * static_cast<double>(a.size())));
  std::vector<float> surface;
  for (const std::complex<float> value : transformed(cross, inverse_)) surface.push_back(value.real());
  return surface;
}

PhaseCorrelation PhaseCorrelator::operator()(std::span<const float> a, std::span<const float> b) const {
  const Spectrum of_a = spectrum_of(a), of_b = spectrum_of(b);
  if (of_a.empty() || of_b.empty()) return {};
  PhaseCorrelation result{.defined = true};
  result.peak = std::ranges::max(surface_of(of_a, of_b, kPeakEpsilon));
  const std::vector<float> surface = surface_of(of_a, of_b, kShiftEpsilon);
  const int top = static_cast<int>(std::ranges::max_element(surface) - surface.begin());
  const int row = top / width_, column = top % width_;
  const auto at = [&](int r, int c) {
    return surface[static_cast<std::size_t>((r + height_) % height_ * width_ + (c + width_) % width_)];
  };
  const double dy = row + parabola_top(at(row - 1, column), at(row, column), at(row + 1, column));
  const double dx = column + parabola_top(at(row, column - 1), at(row, column), at(row, column + 1));
  result.dy_px = dy < height_ / 2.0 ? dy : dy - height_;
  result.dx_px = dx < width_ / 2.0 ? dx : dx - width_;
  return result;
}

}  // namespace supertac
