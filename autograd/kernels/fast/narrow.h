// Convolutions with few outputs (the picture's single channel, a decoder's four taxels).
//
// The gather kernel puts output channels side by side in a vector; with one channel it would leave 15 of 16
// lanes empty. Here taps and output channels together fill the vector:
//   z[p, t, o] = sum over cin of x[p, :] * w[t, :, o]        one matrix product
//   y[q, o]    = bias[o] + sum over taps t of z[q + t, t, o]
// The gradients are one product each with gz[p, t, o] = gy[p - t, o].
#pragma once

#include "autograd/kernels/fast/geometry.h"

namespace supertac::kernels {

/// Whether conv() and its gradients take this way: fewer than half as many outputs as inputs, taps * outputs
/// that fit a vector of 16, and kernels three wide and an odd number high that keep the size of a map. The
/// shapes alone decide, so that all processors agree.
bool is_narrow(const ConvTask& task);

void narrow_conv(const ConvTask& task, const real* x, const real* w, const real* bias, real negative_slope,
                 real* y);
void narrow_grad_x(const ConvTask& task, const real* gy, const real* w, Into into, real* gx);
void narrow_grad_w(const ConvTask& task, const real* x, const real* gy, Into into, real* gw);

}  // namespace supertac::kernels
