// How a network fails in silence: it stops to look at its input, or blows up, while the loss stays finite.
#pragma once

#include <span>
#include <vector>

#include "autograd/tensor.h"

namespace supertac {

/// How much each entry differs within a batch: sums that micro-batches gather and the trainer adds up.
class BatchVariance {
 public:
  BatchVariance() = default;
  explicit BatchVariance(std::size_t entries) : values_(2 * entries) {}
  void clear();
  /// Adds a batch [N,...], whose entries are `first`, first + 1, ... of this object.
  void add(const Tensor& batch, std::size_t first = 0);
  void add(const BatchVariance& other);
  /// Variance of entry i over `samples` samples.
  double variance(std::size_t i, double samples) const;
  /// The mean of all entries' variances.
  double mean_variance(double samples) const;
  std::size_t entries() const { return values_.size() / 2; }
  /// The sums themselves, to be added up over several processes.
  std::span<double> values() { return values_; }

 private:
  std::vector<double> values_;  // a sum for each entry, then a sum of squares for each
};

/// Pictures that say nothing of the truths: their standard deviation over the batch is below 2 % of the
/// truths' (blank ones, or the mean image for every window) or above ten times it (training has diverged).
bool is_degenerate(const BatchVariance& pictures, const BatchVariance& truths, double samples);

/// Latent numbers that tell windows apart: the variance of the encoder's mean over the batch is above 0.01
/// (Burda et al. 2016, section 5.1, "active units"). None is posterior collapse: the decoders ignore z.
int active_latents(const BatchVariance& means, double samples);

}  // namespace supertac
