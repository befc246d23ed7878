#include "autograd/kernels/losses.h"

#include <algorithm>
#include <cmath>

#include "autograd/kernels/exp.h"
#include "autograd/kernels/fast/loops.h"
#include "autograd/kernels/fast/sums.h"

namespace supertac::kernels {

double squared_distance(Dim n, const real* a, const real* b) {
  return sum_lanes(n, [=](Dim i) {
    const double d = static_cast<double>(a[i]) - static_cast<double>(b[i]);
    return d * d;
  });
}

void add_scaled_difference(Dim n, real factor, const real* a, const real* b, real* g) {
  each(n, [=](Dim i) SUPERTAC_LOOP { g[i] += factor * (a[i] - b[i]); });
}

double kl_terms(Dim n, const real* mean, const real* log_var) {
  return sum_lanes(n, [=](Dim i) {
    return static_cast<double>(1 + log_var[i] - mean[i] * mean[i] - exp_same_bits(log_var[i]));
  });
}

void kl_grad_log_var(Dim n, real g, const real* log_var, real* glog_var) {
  each(n, [=](Dim i) SUPERTAC_LOOP { glog_var[i] += g * (exp_same_bits(log_var[i]) - 1) / 2; });
}

// The largest logit is taken off first: e^x of large numbers overflows.
double cross_entropy(Dim classes, const real* logits, Dim label, real* rest) {
  const real largest = *std::max_element(logits, logits + classes);
  double norm = 0;
  for (Dim k = 0; k < classes; ++k) norm += static_cast<double>(rest[k] = exp_same_bits(logits[k] - largest));
  for (Dim k = 0; k < classes; ++k) rest[k] = static_cast<real>(static_cast<double>(rest[k]) / norm);
  rest[label] -= 1;
  return std::log(norm) - static_cast<double>(logits[label] - largest);
}

}  // namespace supertac::kernels
