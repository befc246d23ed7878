// The same sums as autograd/kernels/conv.h, faster: register tiles, instruction sets chosen at run time,
// Winograd's algorithm for batches of larger maps, another one for few output channels. The shapes alone
// decide which one runs, so all processors agree.
#pragma once

#include "autograd/kernels/fast/geometry.h"

namespace supertac::kernels::fast {

void conv(const ConvSizes& sizes, const real* x, const real* w, const real* bias, real negative_slope,
          real* y);
void conv_grad_x(const ConvSizes& sizes, const real* gy, const real* w, Slot gx);
/// Partial sums over fixed groups of images, added in order.
void conv_grad_w(const ConvSizes& sizes, const real* x, const real* gy, Slot gw);

/// w [taps][cin][cout] -> [taps][cout][cin]
Tensor transposed_weights(const real* w, Dim taps, Dim cin, Dim cout);

}  // namespace supertac::kernels::fast

namespace supertac::kernels {

// In narrow.cpp:
/// Whether conv() and its gradients take this way: fewer than half as many outputs as inputs, taps * outputs
/// that fit a vector of 16, and kernels three wide and an odd number high that keep the size of a map. The
/// shapes alone decide, so that all processors agree.
bool is_narrow(const ConvSizes& sizes);

void narrow_conv(const ConvSizes& sizes, const real* x, const real* w, const real* bias, real negative_slope,
                 real* y);
void narrow_grad_x(const ConvSizes& sizes, const real* gy, const real* w, Slot gx);
void narrow_grad_w(const ConvSizes& sizes, const real* x, const real* gy, Slot gw);

// In winograd.cpp:
/// Whether conv() and its gradients take this way: four images or more, of four 4x4 squares or more (8x8,
/// 4x16), channels multiples of 16. Elsewhere the transforms cost more than the products save. The shapes
/// alone decide, so that all processors agree.
bool is_winograd(const ConvSizes& sizes);

void winograd_conv(const ConvSizes& sizes, const real* x, const real* w, const real* bias,
                   real negative_slope, real* y);
void winograd_grad_x(const ConvSizes& sizes, const real* gy, const real* w, Slot gx);
void winograd_grad_w(const ConvSizes& sizes, const real* x, const real* gy, Slot gw);

}  // namespace supertac::kernels
