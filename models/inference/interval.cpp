#include "models/inference/interval.h"

#include <cmath>

#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

// The largest difference between a pixel and those around it; NaN for NaN.
float steepest(std::span<const float> picture, std::size_t width, std::size_t pixel) {
  const std::size_t row = pixel / width, column = pixel % width, rows = picture.size() / width;
  const float value = picture[pixel];
  float most = value - value;
  for (std::size_t y = row - (row > 0); y <= std::min(row + 1, rows - 1); ++y)
    for (std::size_t x = column - (column > 0); x <= std::min(column + 1, width - 1); ++x)
      most = std::max(most, std::abs(picture[y * width + x] - value));  // `most` where that is NaN
  return most;
}

}  // namespace

void PixelInterval::half_widths(std::span<const float> picture, std::int64_t width,
                                std::span<const float> predicted_error, std::vector<float>& widths) const {
  widths.resize(predicted_error.size());
  for (std::size_t i = 0; i < widths.size(); ++i)
    widths[i] = std::min(reach(picture, width, i, predicted_error[i]), 1.0F);  // NaN stays
}

float PixelInterval::reach(std::span<const float> picture, std::int64_t width, std::size_t pixel,
                           float predicted_error) const {
  return static_cast<float>(shift) * steepest(picture, static_cast<std::size_t>(width), pixel) +
         static_cast<float>(factor) * floored(predicted_error);
}

std::string PixelInterval::text() const {
  return (shift > 0 || load > 0 ? format(shift) + "," : "") + format(factor) +
         (load > 0 ? "," + format(load) : "");
}

std::optional<PixelInterval> PixelInterval::read(const std::string& text) {
  const std::vector<std::string> parts = comma_list(text);
  if (parts.empty() || parts.size() > 3) return std::nullopt;
  const auto shift = parts.size() > 1 ? parse_double(parts.front()) : 0.0,
             factor = parse_double(parts[parts.size() > 1 ? 1 : 0]),
             load = parts.size() > 2 ? parse_double(parts.back()) : 0.0;
  if (!shift || !factor || !load || !(*shift >= 0 && *shift <= 10) || !(*factor >= 0.05 && *factor <= 100) ||
      !(*load >= 0 && *load <= 4096))
    return std::nullopt;
  return PixelInterval{*shift, *factor, *load};
}

void PixelInterval::with_load(const NetworkFormat& format, std::span<const float> input,
                              std::span<const float> predicted_error, std::vector<float>& errors) const {
  errors.assign(predicted_error.begin(), predicted_error.end());
  if (load == 0) return;
  const auto columns = static_cast<std::size_t>(format.columns),
             scale = static_cast<std::size_t>(format.scale),
             channels = static_cast<std::size_t>(format.channels), width = columns * scale,
             frame = static_cast<std::size_t>(format.rows) * columns * channels;
  const auto last = input.last(frame);
  const auto share = static_cast<float>(load / static_cast<double>(channels));
  for (std::size_t pixel = 0; pixel < errors.size(); ++pixel) {
    const std::size_t taxel = pixel / width / scale * columns + pixel % width / scale;
    for (const float signal : last.subspan(taxel * channels, channels)) errors[pixel] += share * signal;
  }
}

void IntervalCoverage::add(std::size_t pass, std::span<const float> picture, std::int64_t width,
                           std::span<const float> truth, std::span<const float> predicted_error,
                           std::span<const float> input) {
  if (passes_.empty() || passes_.back().number != pass) passes_.push_back({.number = pass});
  judged_.with_load(format_, input, predicted_error, errors_);
  for (std::size_t i = 0; i < picture.size(); ++i) {
    const auto height = static_cast<std::size_t>(
        std::ranges::count_if(kEdges, [t = std::abs(truth[i])](float edge) { return t > edge; }));
    Height& counts = passes_.back().heights[height];
    const double error = std::abs(double{picture[i]} - double{truth[i]}),
                 reach = double{judged_.reach(picture, width, i, errors_[i])},
                 predicted = double{floored(errors_[i])};
    const double ratio = (error - reach) / predicted + judged_.factor;
    const double bin = std::max(0.0, std::ceil(ratio * kBinsPerUnit - 1e-6) - 1);
    if (bin < double{kBins}) ++counts.ratios[static_cast<std::size_t>(bin)];
    ++counts.pixels;
    counts.within += error <= std::min(reach, 1.0) ? 1 : 0;
    counts.half_width += std::min(reach, 1.0);
  }
}

double IntervalCoverage::share() const {
  double sum = 0;
  for (const Pass& pass : passes_) {
    double within = 0, pixels = 0;
    for (const Height& h : pass.heights)
      within += static_cast<double>(h.within), pixels += static_cast<double>(h.pixels);
    sum += within / pixels;
  }
  return sum / static_cast<double>(passes_.size());
}

IntervalCoverage::Held IntervalCoverage::of_height(std::size_t height) const {
  Held held;
  for (const Pass& pass : passes_) {
    const Height& h = pass.heights[height];
    held.share += static_cast<double>(h.within), held.half_width += h.half_width;
    held.pixels += static_cast<double>(h.pixels);
  }
  return {held.share / held.pixels, held.half_width / held.pixels, held.pixels};
}

double IntervalCoverage::half_width() const {
  double sum = 0, pixels = 0;
  for (const Pass& pass : passes_)
    for (const Height& h : pass.heights) sum += h.half_width, pixels += static_cast<double>(h.pixels);
  return sum / pixels;
}

PixelInterval IntervalCoverage::found() const {
  std::size_t least = 0;  // bins
  for (std::size_t height = 0; height < kHeights; ++height) {
    double passes = 0, covered = 0;
    for (const Pass& pass : passes_) passes += pass.heights[height].pixels > 0 ? 1 : 0;
    std::size_t bin = 0;
    for (; bin < kBins && covered < kCovered * passes * (1 - 1e-12); ++bin)
      for (const Pass& pass : passes_)
        if (const Height& h = pass.heights[height]; h.pixels > 0)
          covered += h.ratios[bin] / static_cast<double>(h.pixels);
    least = std::max(least, bin);
  }
  return {judged_.shift, static_cast<double>(std::max<std::size_t>(least, 1)) / kBinsPerUnit, judged_.load};
}

}  // namespace supertac
