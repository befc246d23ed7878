#include "data/windows/transforms/signal_features.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>

#include "io/numbers/same_bits.h"

namespace supertac {
namespace {

constexpr std::size_t kLeastFrames = 16, kFramesLookedAt = 64, kLagShare = 8;
constexpr double kStillest = 0.0005, kLeastSwing = 0.003;
constexpr std::size_t kSumsAtOnce =
    16;  // sums that run side by side: one alone waits for each of its additions

/// The frames of a window that are looked at, their means taken off.
struct Swings {
  std::span<const float> window, mean;
  std::size_t frames, step;

  double operator()(std::size_t t, std::size_t k) const {
    return double{window[t * step * mean.size() + k]} - double{mean[k]};
  }
};

// The mean over time of value(t, k) for each k of `out`, added up in the order of time.
template <class Value>
void mean_over_time(std::size_t frames, std::span<float> out, const Value& value) {
  for (std::size_t first = 0; first < out.size(); first += kSumsAtOnce) {
    const std::size_t count = std::min(kSumsAtOnce, out.size() - first);
    std::array<double, kSumsAtOnce> sums{};
    for (std::size_t t = 0; t < frames; ++t)
      for (std::size_t k = 0; k < count; ++k) sums[k] += value(t, first + k);
    for (std::size_t k = 0; k < count; ++k)
      out[first + k] = static_cast<float>(sums[k] / static_cast<double>(frames));
  }
}

// How far `width` signals are ahead of as many from `behind` on.
double lead_of(const Swings& x, std::size_t ahead, std::size_t behind, std::size_t width) {
  const std::size_t lag = x.frames / kLagShare;
  double sum = 0;
  for (std::size_t t = 0; t + lag < x.frames; ++t)
    for (std::size_t k = 0; k < width; ++k)
      sum += x(t, ahead + k) * x(t + lag, behind + k) - x(t + lag, ahead + k) * x(t, behind + k);
  return sum / static_cast<double>(x.frames - lag);
}

}  // namespace

std::size_t signal_feature_count(const TaxelArray& array, std::size_t frames) {
  return frames == 1 ? array.signals() : 2 * array.signals() + static_cast<std::size_t>(array.rows - 1);
}

void signal_features(std::span<const float> window, const TaxelArray& array, std::span<float> out) {
  const std::size_t signals = array.signals(), rows = static_cast<std::size_t>(array.rows);
  const std::size_t all = window.size() / signals, expected = signal_feature_count(array, all);
  if (window.size() % signals != 0 || (all != 1 && all < kLeastFrames) || out.size() != expected)
    throw std::invalid_argument("signal features: expects " + std::to_string(kLeastFrames) +
                                " or more frames of " + std::to_string(signals) + " and room for " +
                                std::to_string(expected) + ", got " + std::to_string(window.size()) +
                                " and " + std::to_string(out.size()));
  if (all == 1) {
    std::ranges::copy(window, out.begin());
    return;
  }
  const std::size_t step = std::max<std::size_t>(1, all / kFramesLookedAt);
  const std::span<float> mean = out.first(signals), spread = out.subspan(signals, signals);
  const Swings x{.window = window, .mean = mean, .frames = all / step, .step = step};
  mean_over_time(x.frames, mean,
                 [&](std::size_t t, std::size_t k) { return double{window[t * step * signals + k]}; });
  mean_over_time(x.frames, spread, [&](std::size_t t, std::size_t k) { return x(t, k) * x(t, k); });
  const std::size_t width = signals / rows;
  const auto square_of = [&](std::size_t row) {
    const std::span<const float> variances = spread.subspan(row * width, width);
    return std::accumulate(variances.begin(), variances.end(), 0.0);
  };
  for (std::size_t r = 0; r + 1 < rows; ++r)
    out[2 * signals + r] = static_cast<float>(lead_of(x, r * width, (r + 1) * width, width) /
                                              (std::sqrt(square_of(r) * square_of(r + 1)) + kLeastSwing));
  for (float& s : spread) s = static_cast<float>(same_bits::log(std::sqrt(double{s}) + kStillest));
}

std::vector<float> signal_features(std::span<const float> window, const TaxelArray& array) {
  std::vector<float> features(signal_feature_count(array, window.size() / array.signals()));
  signal_features(window, array, features);
  return features;
}

}  // namespace supertac
