// The same sums as autograd/kernels/conv.h and autograd/ops/linear.h, faster: register tiles, instruction
// sets chosen at run time, Winograd's algorithm for batches of larger maps (winograd.h), another one for few
// output channels (narrow.h). The shapes alone decide which one runs, so all processors agree.
#pragma once

#include "autograd/kernels/conv.h"

namespace supertac::kernels::fast {

void conv(const ConvSizes& sizes, const real* x, const real* w, const real* bias, real negative_slope,
          real* y);
void conv_grad_x(const ConvSizes& sizes, const real* gy, const real* w, Into into, real* gx);
/// Partial sums over fixed groups of images, added in order.
void conv_grad_w(const ConvSizes& sizes, const real* x, const real* gy, Into into, real* gw);

void linear(Dim rows, Dim cin, Dim cout, const real* x, const real* w, const real* bias, real negative_slope,
            real* y);
void linear_grad_x(Dim rows, Dim cin, Dim cout, const real* gy, const real* w, Into into, real* gx);
void linear_grad_w(Dim rows, Dim cin, Dim cout, const real* x, const real* gy, Into into, real* gw);

/// w [taps][cin][cout] -> [taps][cout][cin]
Tensor transposed_weights(const real* w, Dim taps, Dim cin, Dim cout);

}  // namespace supertac::kernels::fast
