#include "models/training/loss/collapse.h"

#include <algorithm>

namespace supertac {
namespace {

constexpr double kLeastShare = 0.02, kLargestShare = 10;  // of the truths' standard deviation
constexpr double kActiveVariance = 0.01;                  // Burda et al. 2016

}  // namespace

void BatchVariance::clear() { std::fill(values_.begin(), values_.end(), 0.0); }

void BatchVariance::add(const Tensor& batch, std::size_t first) {
  const Dim samples = batch.dim(0), count = samples > 0 ? batch.size() / samples : 0;
  const real* x = batch.data();
  for (Dim n = 0; n < samples; ++n) {
    double *sum = &values_[first], *squares = &values_[entries() + first];
    for (Dim i = 0; i < count; ++i) {
      const auto value = static_cast<double>(*x++);
      sum[i] += value;
      squares[i] += value * value;
    }
  }
}

void BatchVariance::add(const BatchVariance& other) {
  for (std::size_t i = 0; i < values_.size(); ++i) values_[i] += other.values_[i];
}

double BatchVariance::variance(std::size_t i, double samples) const {
  const double mean = values_[i] / samples;
  return std::max(0.0, values_[entries() + i] / samples - mean * mean);
}

double BatchVariance::mean_variance(double samples) const {
  double total = 0;
  for (std::size_t i = 0; i < entries(); ++i) total += variance(i, samples);
  return total / static_cast<double>(entries());
}

bool is_degenerate(const BatchVariance& pictures, const BatchVariance& truths, double samples) {
  const double own = pictures.mean_variance(samples), due = truths.mean_variance(samples);
  return own < kLeastShare * kLeastShare * due || (due > 0 && own > kLargestShare * kLargestShare * due);
}

int active_latents(const BatchVariance& means, double samples) {
  int active = 0;
  for (std::size_t i = 0; i < means.entries(); ++i) active += means.variance(i, samples) > kActiveVariance;
  return active;
}

}  // namespace supertac
