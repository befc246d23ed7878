// The arithmetic of losses and of the VAE's sample, callable without a graph. It checks nothing. Sizes count
// elements; arrays of one function have one shape.
#pragma once

#include <algorithm>
#include <cmath>

#include "autograd/kernels/exp.h"
#include "autograd/kernels/fast/each.h"

namespace supertac::kernels {

/// Gradients: where it says = below, a Slot may say += instead.

/// The sum of (x - target)^2 over n elements.
inline double squared_error(Dim n, const real* x, const real* target) {
  return sum_of(n, [=](Dim i) {
    const double d = static_cast<double>(x[i]) - static_cast<double>(target[i]);
    return d * d;
  });
}
/// gx = twice_g (x - target),  gtarget = -gx
inline void squared_error_grad(Dim n, real twice_g, const real* x, const real* target, Slot gx,
                               Slot gtarget) {
  each_into(n, gx, [=](Dim i) { return twice_g * (x[i] - target[i]); });
  each_into(n, gtarget, [=](Dim i) { return twice_g * (target[i] - x[i]); });
}

/// -log softmax(logits)[label] of one row of classes; `rest` becomes softmax(logits) - onehot(label), its
/// gradient. The largest logit is taken off first: e^x of large numbers overflows.
inline double cross_entropy(Dim classes, const real* logits, Dim label, real* rest) {
  const real largest = *std::max_element(logits, logits + classes);
  double norm = 0;
  for (Dim k = 0; k < classes; ++k) norm += static_cast<double>(rest[k] = exp_same_bits(logits[k] - largest));
  for (Dim k = 0; k < classes; ++k) rest[k] = static_cast<real>(static_cast<double>(rest[k]) / norm);
  rest[label] -= 1;
  return std::log(norm) - static_cast<double>(logits[label] - largest);
}

/// z = mean + e^(log_var / 2) eps
inline void sample_gaussian(Dim size, const real* mean, const real* log_var, const real* eps, real* z) {
  each(size, [=](Dim i) { z[i] = mean[i] + exp_same_bits(log_var[i] / 2) * eps[i]; });
}
/// gmean = gz,  glog_var = gz (z - mean) / 2, which is half of e^(log_var / 2) eps
inline void sample_gaussian_grad(Dim size, const real* gz, const real* z, const real* mean, Slot gmean,
                                 Slot glog_var) {
  each_into(size, gmean, [=](Dim i) { return gz[i]; });
  each_into(size, glog_var, [=](Dim i) { return gz[i] * (z[i] - mean[i]) / 2; });
}

/// -1/2 of the sum over `size` latents of 1 + log_var - mean^2 - e^log_var
inline double kl_divergence(Dim size, const real* mean, const real* log_var) {
  return -0.5 *
         sum_of(size, [=](Dim i) { return 1 + log_var[i] - mean[i] * mean[i] - exp_same_bits(log_var[i]); });
}
/// gmean = g mean,  glog_var = g (e^log_var - 1) / 2
inline void kl_divergence_grad(Dim size, real g, const real* mean, const real* log_var, Slot gmean,
                               Slot glog_var) {
  each_into(size, gmean, [=](Dim i) { return g * mean[i]; });
  each_into(size, glog_var, [=](Dim i) { return g * (exp_same_bits(log_var[i]) - 1) / 2; });
}

/// The sum over images and their mean over window positions of the similarity of x and target, both [images,
/// height, width], whose shorter side is 3 or more (autograd/ops/losses.h).
double ssim(Dim images, Dim height, Dim width, const real* x, const real* target);
/// gx = or += g times its derivative by x.
void ssim_grad(Dim images, Dim height, Dim width, real g, const real* x, const real* target, Slot gx);

}  // namespace supertac::kernels
