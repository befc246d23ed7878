#include "models/inference/novelty.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>

#include "autograd/kernels/fast/pool.h"
#include "io/numbers/same_bits.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr const char *kMean = "novelty.mean", *kWhitening = "novelty.whitening", *kLimit = "novelty.limit";
constexpr double kLeastVariance = 1e-3, kTail = 0.001, kMargin = 1.3;
constexpr std::size_t kRows = 8;  // whose sums run side by side

using Matrix = std::vector<double>;  // [D][D]

Matrix covariance_of(const Tensor& features, const std::vector<double>& mean) {
  const auto n = static_cast<std::size_t>(features.dim(0)), d = mean.size();
  Matrix sum(d * d);
  for (std::size_t row = 0; row < n; ++row) {
    const std::span<const real> z = features.values().subspan(row * d, d);
    for (std::size_t i = 0; i < d; ++i)
      for (std::size_t j = 0; j <= i; ++j) sum[i * d + j] += (z[i] - mean[i]) * (z[j] - mean[j]);
  }
  for (double& s : sum) s /= static_cast<double>(n - 1);
  for (std::size_t i = 0; i < d; ++i) sum[i * d + i] += kLeastVariance;
  return sum;
}

// The lower triangle L of a positive definite L L^T, in place (Cholesky-Banachiewicz). Not LAPACK's: what is
// stored in a model file must have the same bits everywhere.
void factorise(Matrix& a, std::size_t d) {
  for (std::size_t i = 0; i < d; ++i)
    for (std::size_t j = 0; j <= i; ++j) {
      double sum = a[i * d + j];
      for (std::size_t k = 0; k < j; ++k) sum -= a[i * d + k] * a[j * d + k];
      a[i * d + j] = i == j ? std::sqrt(sum) : sum / a[j * d + j];
    }
}

Matrix inverse_of_lower(const Matrix& l, std::size_t d) {
  Matrix inverse(d * d);
  for (std::size_t column = 0; column < d; ++column)
    for (std::size_t i = column; i < d; ++i) {
      double sum = i == column ? 1 : 0;
      for (std::size_t k = column; k < i; ++k) sum -= l[i * d + k] * inverse[k * d + column];
      inverse[i * d + column] = sum / l[i * d + i];
    }
  return inverse;
}

constexpr std::size_t kLeastFrames = 16, kFramesLookedAt = 64, kLagShare = 8;
constexpr double kStillest = 0.0005, kLeastSwing = 0.003;

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
  std::vector<double, PoolAllocator<double>> sums(out.size());  // a window takes no heap
  for (std::size_t t = 0; t < frames; ++t)
    for (std::size_t k = 0; k < sums.size(); ++k) sums[k] += value(t, k);
  std::ranges::transform(sums, out.begin(),
                         [&](double sum) { return static_cast<float>(sum / static_cast<double>(frames)); });
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
    throw std::invalid_argument(
        refusal("signal features", "window",
                "1 frame or " + std::to_string(kLeastFrames) + " or more of " + std::to_string(signals) +
                    " signals, and out room for " + std::to_string(expected),
                std::to_string(window.size()) + " signals and room for " + std::to_string(out.size())));
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

Novelty::Novelty(const Tensor& features) {
  const Dim n = features.rank() == 2 ? features.dim(0) : 0, d = features.rank() == 2 ? features.dim(1) : 0;
  if (d < 1 || n <= d)
    throw std::invalid_argument(refusal("novelty", "features", "[N,D] with N > D", features.text()));
  const auto count = static_cast<std::size_t>(n), size = static_cast<std::size_t>(d);
  std::vector<double> mean(size);
  for (std::size_t i = 0; i < count * size; ++i) mean[i % size] += features.values()[i];
  for (double& m : mean) m /= static_cast<double>(n);
  Matrix l = covariance_of(features, mean);
  factorise(l, size);
  mean_.assign(mean.begin(), mean.end());
  const Matrix whitening = inverse_of_lower(l, size);
  whitening_.assign(whitening.begin(), whitening.end());
  std::vector<double> distances;
  for (std::size_t row = 0; row < count; ++row)
    distances.push_back(distance(features.values().subspan(row * size, size)));
  const auto tail = std::min(count - 1, static_cast<std::size_t>((1 - kTail) * static_cast<double>(count)));
  std::ranges::nth_element(distances, distances.begin() + static_cast<std::ptrdiff_t>(tail));
  limit_ = static_cast<float>(kMargin * distances[tail]);
}

double Novelty::distance(std::span<const float> features) const {
  const std::size_t d = mean_.size();
  if (features.size() != d)
    throw std::invalid_argument(refusal("novelty", "features", "[" + std::to_string(d) + "]",
                                        "[" + std::to_string(features.size()) + "]"));
  double squares = 0;
  for (std::size_t i = 0; i < d; i += kRows) {
    const std::size_t rows = std::min(kRows, d - i);
    std::array<double, kRows> sums{};
    for (std::size_t j = 0; j < i + rows; ++j)
      for (std::size_t r = j > i ? j - i : 0; r < rows; ++r)
        sums[r] +=
            static_cast<double>(whitening_[(i + r) * d + j]) * (static_cast<double>(features[j]) - mean_[j]);
    for (std::size_t r = 0; r < rows; ++r) squares += sums[r] * sums[r];
  }
  return std::sqrt(squares / static_cast<double>(d));
}

std::vector<StoredTensor> Novelty::stored() const {
  const std::uint64_t d = mean_.size();
  return {{kMean, {d}, mean_}, {kWhitening, {d, d}, whitening_}, {kLimit, {1}, {limit_}}};
}

std::optional<Novelty> Novelty::read(const SafetensorsFile& file, std::size_t features) {
  if (!file.tensors().contains(kLimit)) return std::nullopt;
  const std::uint64_t d = features;
  const auto tensor = [&](const char* name, const std::vector<std::uint64_t>& shape) {
    const auto found = file.tensors().find(name);
    if (found == file.tensors().end() || found->second.shape != shape)
      throw std::runtime_error(file.path() + ": the tensor " + name + " does not fit a model of " +
                               std::to_string(d) + " features; train it again");
    return file.f32(name);
  };
  Novelty novelty;
  novelty.mean_ = tensor(kMean, {d});
  novelty.whitening_ = tensor(kWhitening, {d, d});
  novelty.limit_ = tensor(kLimit, {1}).front();
  return novelty;
}

}  // namespace supertac
