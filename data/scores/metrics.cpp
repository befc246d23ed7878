#include "data/scores/metrics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>

#include "data/plates/truth.h"
#include "io/numbers/numbers.h"
#include "io/numbers/random.h"
#include "io/numbers/same_bits.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr int kGaussianSize = 11, kUniformSize = 7, kFewestPixels = 3;
constexpr double kC1 = 0.01 * 0.01, kC2 = 0.03 * 0.03;

// One-dimensional weights of SSIM's window; the two-dimensional ones are their products.
std::vector<double> ssim_weights(int size) {
  if (size < kGaussianSize) {
    const int side = std::min(kUniformSize, (size - 1) / 2 * 2 + 1);
    return std::vector<double>(static_cast<std::size_t>(side), 1.0 / side);
  }
  std::vector<double> weights(kGaussianSize);
  double sum = 0;
  for (int i = 0; i < kGaussianSize; ++i) {
    const double d = (i - kGaussianSize / 2) / 1.5;
    sum += weights[static_cast<std::size_t>(i)] = same_bits::exp(-0.5 * d * d);
  }
  for (double& w : weights) w /= sum;
  return weights;
}

// SSIM of the window whose first pixels are a and b, rows `stride` apart.
double local_ssim(const float* a, const float* b, std::size_t stride, const std::vector<double>& weights) {
  const std::size_t n = weights.size();
  double mean_a = 0, mean_b = 0;
  for (std::size_t r = 0; r < n; ++r) {
    for (std::size_t c = 0; c < n; ++c) {
      const double w = weights[r] * weights[c];
      mean_a += w * a[r * stride + c];
      mean_b += w * b[r * stride + c];
    }
  }
  double var_a = 0, var_b = 0, cov = 0;
  for (std::size_t r = 0; r < n; ++r) {
    for (std::size_t c = 0; c < n; ++c) {
      const double w = weights[r] * weights[c];
      const double da = a[r * stride + c] - mean_a, db = b[r * stride + c] - mean_b;
      var_a += w * da * da;
      var_b += w * db * db;
      cov += w * da * db;
    }
  }
  return (2 * mean_a * mean_b + kC1) * (2 * cov + kC2) /
         ((mean_a * mean_a + mean_b * mean_b + kC1) * (var_a + var_b + kC2));
}

enum Of : std::uint8_t { kWindows, kPositions, kSilent, kFelt };

struct Figure {
  const char* name;
  double Metrics::*value;
  Of of;  // it is a mean of these
};
constexpr Figure kFigures[] = {{"psnr_mean_db", &Metrics::psnr_mean_db, kWindows},
                               {"psnr_pooled_db", &Metrics::psnr_pooled_db, kWindows},
                               {"ssim", &Metrics::ssim, kWindows},
                               {"phase_correlation", &Metrics::phase_correlation, kPositions},
                               {"phase_correlation_floor", &Metrics::phase_correlation_floor, kPositions},
                               {"position_error_px", &Metrics::position_error_px, kPositions},
                               {"position_error_mm", &Metrics::position_error_mm, kPositions},
                               {"ghost_rate", &Metrics::ghost_rate, kSilent},
                               {"miss_rate", &Metrics::miss_rate, kFelt}};

// The value farthest from 0.
float extent(std::span<const float> image) {
  const auto [low, high] = std::minmax_element(image.begin(), image.end());
  return std::max(*high, -*low);
}

}  // namespace

double mean_squared_error(std::span<const float> a, std::span<const float> b) {
  if (a.empty()) throw std::invalid_argument(refusal("mean_squared_error", "image", "a pixel or more", "0"));
  expect_values("mean_squared_error", "image", a.size(), b.size());
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double d = static_cast<double>(a[i]) - b[i];
    sum += d * d;
  }
  return sum / static_cast<double>(a.size());
}

double psnr_db(double mse) { return mse > 0 ? std::min(kPsnrCapDb, -10 * std::log10(mse)) : kPsnrCapDb; }

double ssim(std::span<const float> a, std::span<const float> b, std::size_t height, std::size_t width) {
  const std::size_t smaller = std::min(height, width);
  if (smaller < kFewestPixels)
    throw std::invalid_argument(refusal("ssim", "size", "3 pixels or more", std::to_string(smaller)));
  expect_values("ssim", "image", height * width, a.size());
  expect_values("ssim", "image", height * width, b.size());
  const std::vector<double> weights = ssim_weights(static_cast<int>(smaller));
  const std::size_t rows = height - weights.size() + 1, columns = width - weights.size() + 1;
  double sum = 0;
  for (std::size_t r = 0; r < rows; ++r)
    for (std::size_t c = 0; c < columns; ++c)
      sum += local_ssim(&a[r * width + c], &b[r * width + c], width, weights);
  return sum / static_cast<double>(rows * columns);
}

nlohmann::ordered_json to_json(const Metrics& metrics) {
  nlohmann::ordered_json json;
  json["windows"] = metrics.windows;
  for (const auto& [name, value, of] : kFigures)
    json[name] =
        std::isfinite(metrics.*value) ? nlohmann::ordered_json(metrics.*value) : nlohmann::ordered_json();
  return json;
}

ImageScores ZoneMetrics::scores_of(std::span<const float> output, std::span<const float> truth) const {
  for (std::size_t i = 0; i < output.size(); ++i)
    if (!std::isfinite(output[i]))
      throw std::invalid_argument(
          refusal("metrics", "output pixel " + std::to_string(i), "a finite number", format(output[i])));
  ImageScores scores;
  scores.mse = mean_squared_error(output, truth);
  scores.ssim =
      ssim(output, truth, static_cast<std::size_t>(grid_.height), static_cast<std::size_t>(grid_.width));
  const auto [low, high] = std::minmax_element(truth.begin(), truth.end());
  scores.has_position = *high - *low > 2 * PhaseCorrelator::kFlat;
  if (!scores.has_position) return scores;
  const PhaseCorrelation phase = correlator_(output, truth);
  scores.phase_correlation = phase.peak;
  const Pitch pixel = grid_.pixel_mm;
  scores.position_error_px =
      phase.defined ? std::hypot(phase.dx_px, phase.dy_px) : std::min(grid_.height, grid_.width) / 2.0;
  // Of square pixels the same digits as ever.
  if (pixel.x == pixel.y)
    scores.position_error_mm = scores.position_error_px * pixel.x;
  else
    scores.position_error_mm = phase.defined ? std::hypot(phase.dx_px * pixel.x, phase.dy_px * pixel.y)
                                             : std::min(grid_.height_mm(), grid_.width_mm()) / 2;
  return scores;
}

MetricsAccumulator::MetricsAccumulator(const ImageGrid& grid) : grid_(grid) {
  for (const Figure& figure : kFigures) sums_.*figure.value = 0;
}

void MetricsAccumulator::add(std::span<const float> output, std::span<const float> truth,
                             const ImageScores& scores, float silent) {
  ++counts_[kWindows];
  sums_.psnr_mean_db += psnr_db(scores.mse), sums_.psnr_pooled_db += scores.mse;
  sums_.ssim += scores.ssim;
  const float there = extent(truth), drawn = extent(output);
  if (there <= silent) ++counts_[kSilent], sums_.ghost_rate += drawn > Metrics::kGhost ? 1 : 0;
  if (there > Metrics::kFelt) ++counts_[kFelt], sums_.miss_rate += drawn < Metrics::kGhost ? 1 : 0;
  if (!scores.has_position) return;
  sample(output, truth);
  ++counts_[kPositions];
  sums_.phase_correlation += scores.phase_correlation;
  sums_.position_error_px += scores.position_error_px, sums_.position_error_mm += scores.position_error_mm;
}

// Reservoir sampling (algorithm R): after n windows each is in the sample with the same probability.
void MetricsAccumulator::sample(std::span<const float> output, std::span<const float> truth) {
  const std::uint64_t n = counts_[kPositions];
  if (n < kFloorPairs) {
    sampled_outputs_.insert(sampled_outputs_.end(), output.begin(), output.end());
    sampled_truths_.insert(sampled_truths_.end(), truth.begin(), truth.end());
    return;
  }
  const double u = RandomStream(stream_named("floor"), 0).uniform(n);
  const auto slot = static_cast<std::uint64_t>(u * static_cast<double>(n + 1));
  if (slot >= kFloorPairs) return;
  const auto at = static_cast<std::ptrdiff_t>(slot * output.size());
  std::copy(output.begin(), output.end(), sampled_outputs_.begin() + at);
  std::copy(truth.begin(), truth.end(), sampled_truths_.begin() + at);
}

double MetricsAccumulator::floor() const {
  const std::size_t pixels = grid_.pixels();
  const std::size_t count = sampled_truths_.size() / pixels;
  if (count < 2) return Metrics::kNone;
  std::vector<std::size_t> partner(count);
  std::iota(partner.begin(), partner.end(), std::size_t{0});
  // Sattolo's shuffle: one cycle, so nobody meets himself.
  const RandomStream random(stream_named("floor"), 1);
  for (std::size_t i = count - 1; i > 0; --i)
    std::swap(partner[i], partner[static_cast<std::size_t>(random.uniform(i) * static_cast<double>(i))]);
  const PhaseCorrelator correlator(grid_.height, grid_.width);
  double sum = 0;
  for (std::size_t i = 0; i < count; ++i)
    sum += correlator(std::span(sampled_outputs_).subspan(i * pixels, pixels),
                      std::span(sampled_truths_).subspan(partner[i] * pixels, pixels))
               .peak;
  return sum / static_cast<double>(count);
}

Metrics MetricsAccumulator::result() const {
  Metrics metrics{.windows = counts_[kWindows]};
  for (const auto& [name, value, of] : kFigures)
    if (counts_[of] > 0) metrics.*value = sums_.*value / static_cast<double>(counts_[of]);
  if (metrics.windows > 0) metrics.psnr_pooled_db = psnr_db(metrics.psnr_pooled_db);
  if (counts_[kPositions] > 0) metrics.phase_correlation_floor = floor();
  return metrics;
}

ZoneMetrics::ZoneMetrics(const ImageGrid& grid)
    : grid_(grid), correlator_(grid.height, grid.width), parts_(kParts, MetricsAccumulator(grid)) {}

bool ZoneMetrics::on_edge(std::span<const float> truth, float level) const {
  const auto height = static_cast<std::size_t>(grid_.height), width = static_cast<std::size_t>(grid_.width);
  for (std::size_t p = 0; p < truth.size(); ++p)
    if ((p < width || p >= (height - 1) * width || p % width == 0 || p % width == width - 1) &&
        truth[p] > level)
      return true;
  return false;
}

void ZoneMetrics::add(std::span<const float> output, std::span<const float> truth, Zone zone,
                      std::optional<float> contact_level) {
  const ImageScores scores = scores_of(output, truth);
  const float silent = contact_level.value_or(0);
  const bool contact = zone == Zone::contact;
  const bool belongs[kParts] = {true, contact, zone == Zone::flat, zone == Zone::air,
                                contact && contact_level && on_edge(truth, silent)};
  for (std::size_t p = 0; p < kParts; ++p)
    if (belongs[p]) parts_[p].add(output, truth, scores, silent);
}

nlohmann::ordered_json ZoneMetrics::to_json() const {
  constexpr const char* kNames[kParts] = {"all", "contact", "flat", "air", "edge"};
  nlohmann::ordered_json json;
  for (std::size_t p = 0; p < kParts; ++p)
    if (const Metrics metrics = parts_[p].result(); p != kEdge || metrics.windows > 0)
      json[kNames[p]] = supertac::to_json(metrics);
  return json;
}

}  // namespace supertac
