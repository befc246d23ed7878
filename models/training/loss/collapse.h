// How a network fails in silence, when it stops looking at its input or blows up while the loss stays finite;
// and where in the network it began, when the loss is not finite.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "layers/module.h"

namespace supertac {

/// How much each entry differs within a batch: a view of sums that micro-batches gather and the trainer adds
/// up.
struct BatchVariance {
  std::span<double> values;  ///< a sum for each entry, then a sum of squares for each

  /// Adds a batch [N,...], whose entries are `first`, first + 1, ... of this object.
  void add(const Tensor& batch, std::size_t first = 0);
  /// Variance of entry i over `samples` samples.
  double variance(std::size_t i, double samples) const;
  /// The mean of all entries' variances.
  double mean_variance(double samples) const;
  std::size_t entries() const { return values.size() / 2; }
};

/// Pictures that say nothing of the truths: their standard deviation over the batch is below 2 % of the
/// truths' (blank ones, or the mean image for every window) or above ten times it (training has diverged).
bool is_degenerate(const BatchVariance& pictures, const BatchVariance& truths, double samples);

/// Latent numbers that tell windows apart: the variance of the encoder's mean over the batch is above 0.01
/// (Burda et al. 2016, section 5.1, "active units"). None is posterior collapse: the decoders ignore z.
int active_latents(const BatchVariance& means, double samples);

/// The first value in the order of computation that is not finite, in words: "parameter upsampler.out.bias is
/// not finite", "an input of conv1d in encoder.0.conv.0 is not finite" or "the output of conv2d in
/// upsampler.rirb.0.conv is the first that is not finite". An op without parameters is said to be behind the
/// last layer before it. Empty when all values of the loss's graph are finite. Of a graph that backward() has
/// freed the loss alone is left, "an input".
std::string where_not_finite(const Variable& loss, const std::vector<Parameter>& parameters);

/// The parameter nearest to the loss whose gradient is not finite, its name; empty when all are.
std::string gradient_not_finite(const std::vector<Parameter>& parameters);

}  // namespace supertac
