// Channel means and sums with scaled channels, [images, pixels, channels]. Gradients are added where `Into`
// does not say otherwise.
#pragma once

#include "autograd/tensor.h"

namespace supertac::kernels {

void channel_mean(Dim images, Dim pixels, Dim channels, const real* x, real* y);
void channel_mean_grad(Dim images, Dim pixels, Dim channels, const real* gy, real* gx);

void gated_sum(Dim images, Dim pixels, Dim channels, const real* a, const real* x, const real* s, real* y);
void gated_sum_grad_x(Dim images, Dim pixels, Dim channels, const real* gy, const real* s, Into into,
                      real* gx);
void gated_sum_grad_s(Dim images, Dim pixels, Dim channels, const real* gy, const real* x, real* gs);

}  // namespace supertac::kernels
