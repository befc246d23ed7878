// The same sums as kernels/conv.h and ops/linear.h, faster: register tiles, instruction sets chosen at
// run time, Winograd's way for batches of larger maps, one of its own for few outputs. Which way is taken
// depends on the shapes only, so all processors agree.
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

/// w [taps][cin][cout] -> [taps][cout][cin], for all micro-batches of a training step once (weight_forms.h).
Tensor transposed_weights(const real* w, Dim taps, Dim cin, Dim cout);

}  // namespace supertac::kernels::fast
