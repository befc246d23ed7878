#include "data/scores/baselines.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "data/windows/split.h"

namespace supertac {
namespace {

std::vector<std::uint32_t> fitted_on(std::span<const std::uint32_t> train) {
  if (train.empty()) throw std::invalid_argument("baseline: there is no example to fit to");
  return evenly_spaced(train, kFitWindows);
}

void check_size(const char* what, std::size_t got, std::size_t expected) {
  if (got != expected)
    throw std::invalid_argument("baseline: " + std::string(what) + " expects " + std::to_string(expected) +
                                " values, got " + std::to_string(got));
}

void check_input(std::span<const float> input, const TaxelArray& array) {
  if (input.empty() || input.size() % array.signals() != 0)
    throw std::invalid_argument("baseline: an input is [T][" + std::to_string(array.signals()) + "], got " +
                                std::to_string(input.size()) + " values");
}

double keys_kernel(double distance) {
  constexpr double a = -0.5;
  const double d = std::abs(distance);
  if (d < 1) return ((a + 2) * d - (a + 3)) * d * d + 1;
  if (d < 2) return ((a * d - 5 * a) * d + 8 * a) * d - 4 * a;
  return 0;
}

// Of the taxels of a line on its pixels, [pixels][taxels].
std::vector<float> weights_of(int taxels, int scale) {
  std::vector<float> weights(static_cast<std::size_t>(taxels) * static_cast<std::size_t>(taxels) *
                             static_cast<std::size_t>(scale));
  for (int p = 0; p < taxels * scale; ++p) {
    const double u = (p + 0.5) / scale - 0.5;
    const int left = static_cast<int>(std::floor(u));
    float* row = &weights[static_cast<std::size_t>(p) * static_cast<std::size_t>(taxels)];
    const auto inside = [&](int taxel) { return static_cast<std::size_t>(std::clamp(taxel, 0, taxels - 1)); };
    for (int taxel = left - 1; taxel <= left + 2; ++taxel)
      row[inside(taxel)] += static_cast<float>(keys_kernel(u - taxel));
  }
  return weights;
}

}  // namespace

MeanImage::MeanImage(const WindowSet& windows, std::span<const std::uint32_t> train)
    : array_(windows.array()), image_(windows.image().pixels()) {
  std::vector<double> sum(image_.size());
  std::vector<float> truth(image_.size());
  const std::vector<std::uint32_t> chosen = fitted_on(train);
  for (const std::uint32_t i : chosen) {
    windows.truth(i, truth);
    for (std::size_t p = 0; p < sum.size(); ++p) sum[p] += truth[p];
  }
  for (std::size_t p = 0; p < sum.size(); ++p)
    image_[p] = static_cast<float>(sum[p] / static_cast<double>(chosen.size()));
}

void MeanImage::predict(std::span<const float> input, std::span<float> out) const {
  check_input(input, array_);
  check_size("the image", out.size(), image_.size());
  std::copy(image_.begin(), image_.end(), out.begin());
}

Bicubic::Bicubic(int rows, int columns, int scale) {
  if (rows < 1 || columns < 1 || scale < 1)
    throw std::invalid_argument("bicubic: rows, columns and scale must be at least 1, got " +
                                std::to_string(rows) + ", " + std::to_string(columns) + " and " +
                                std::to_string(scale));
  rows_ = static_cast<std::size_t>(rows);
  columns_ = static_cast<std::size_t>(columns);
  down_ = weights_of(rows, scale);
  across_ = weights_of(columns, scale);
}

void Bicubic::operator()(std::span<const float> frame, std::span<float> out) const {
  const std::size_t height = down_.size() / rows_, width = across_.size() / columns_;
  check_size("a frame", frame.size(), rows_ * columns_);
  check_size("the image", out.size(), height * width);
  std::vector<float> row(columns_);  // the frame's columns at this row of the image
  for (std::size_t r = 0; r < height; ++r) {
    std::fill(row.begin(), row.end(), 0.0F);
    for (std::size_t k = 0; k < frame.size(); ++k)
      row[k % columns_] += down_[r * rows_ + k / columns_] * frame[k];
    for (std::size_t c = 0; c < width; ++c) {
      float value = 0;
      for (std::size_t k = 0; k < columns_; ++k) value += across_[c * columns_ + k] * row[k];
      out[r * width + c] = value;
    }
  }
}

UpsampledFrame::UpsampledFrame(const WindowSet& windows, std::span<const std::uint32_t> train)
    : array_(windows.array()),
      delay_frames_(windows.delay_frames()),
      upsampling_(array_.rows, array_.columns, windows.scale()) {
  const std::size_t pixels = windows.image().pixels();
  std::vector<float> image(pixels), truth(pixels);
  double sx = 0, sy = 0, sxx = 0, sxy = 0;
  const std::vector<std::uint32_t> chosen = fitted_on(train);
  std::vector<float> input(windows.input_size());
  for (const std::uint32_t i : chosen) {
    windows.window(i, input);
    upsampling_(mean_of_channels(array_, shown(input)), image);
    windows.truth(i, truth);
    for (std::size_t p = 0; p < pixels; ++p) {
      sx += image[p];
      sy += truth[p];
      sxx += static_cast<double>(image[p]) * image[p];
      sxy += static_cast<double>(image[p]) * truth[p];
    }
  }
  const double n = static_cast<double>(chosen.size()) * static_cast<double>(pixels);
  const double variance = sxx - sx * sx / n;
  slope_ = variance > 1e-12 * n ? (sxy - sx * sy / n) / variance : 0;
  intercept_ = (sy - slope_ * sx) / n;
}

void UpsampledFrame::predict(std::span<const float> input, std::span<float> out) const {
  check_input(input, array_);
  upsampling_(mean_of_channels(array_, shown(input)), out);
  for (float& v : out) v = static_cast<float>(slope_ * v + intercept_);
}

Baselines fit_baselines(const WindowSet& windows, std::span<const std::uint32_t> train,
                        const FitProgress& progress) {
  Baselines baselines;
  baselines.push_back(std::make_unique<MeanImage>(windows, train));
  baselines.push_back(std::make_unique<UpsampledFrame>(windows, train));
  baselines.push_back(std::make_unique<Ridge>(windows, train, progress));
  return baselines;
}

}  // namespace supertac
