#include "models/inference/novelty.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

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

}  // namespace

Novelty::Novelty(const Tensor& features) {
  const Dim n = features.rank() == 2 ? features.dim(0) : 0, d = features.rank() == 2 ? features.dim(1) : 0;
  if (d < 1 || n <= d)
    throw std::invalid_argument("novelty: expects features [N,D] with N > D, got " + features.shape().text());
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
    throw std::invalid_argument("novelty: expects " + std::to_string(d) + " features, got " +
                                std::to_string(features.size()));
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

std::optional<Novelty> Novelty::read(const SafetensorsFile& file, const std::string& path,
                                     std::size_t features) {
  if (!file.tensors().contains(kLimit)) return std::nullopt;
  const std::uint64_t d = features;
  const auto tensor = [&](const char* name, const std::vector<std::uint64_t>& shape) {
    const auto found = file.tensors().find(name);
    if (found == file.tensors().end() || found->second.shape != shape)
      throw std::runtime_error(path + ": the tensor " + name + " does not fit a model of " +
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
