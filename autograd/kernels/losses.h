// Losses over plain arrays, callable without a graph. Gradients are added.
#pragma once

#include <cstdint>

#include "autograd/tensor.h"

namespace supertac::kernels {

/// The sum of (a - b)^2, and g += factor (a - b)
double squared_distance(Dim n, const real* a, const real* b);
void add_scaled_difference(Dim n, real factor, const real* a, const real* b, real* g);

/// The sum of 1 + log_var - mean^2 - e^log_var, and glog_var += g (e^log_var - 1) / 2
double kl_terms(Dim n, const real* mean, const real* log_var);
void kl_grad_log_var(Dim n, real g, const real* log_var, real* glog_var);

/// -log softmax(logits)[label] of one row of classes; `rest` becomes softmax(logits) - onehot(label), its
/// gradient.
double cross_entropy(Dim classes, const real* logits, Dim label, real* rest);

}  // namespace supertac::kernels
