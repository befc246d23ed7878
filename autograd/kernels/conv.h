// Convolution of any kind over a batch, callable without a graph. Channels-last: x [N, pixels, cin].
#pragma once

#include "autograd/kernels/fast/geometry.h"

namespace supertac::kernels {

struct ConvSizes {
  const Geometry* geometry;
  Dim images, cin, cout;
};

/// y [N, out_pixels, cout] = f(bias + sum over taps of x [N, in_pixels, cin] * w [taps, cin, cout]); bias may
/// be null; f(s) = s for s > 0, else negative_slope * s.
void conv(const ConvSizes& sizes, const real* x, const real* w, const real* bias, real negative_slope,
          real* y);
/// gx = or += the transpose of conv (without f) applied to gy.
void conv_grad_x(const ConvSizes& sizes, const real* gy, const real* w, Into into, real* gx);
/// gw [taps, cin, cout] += x^T gy over all pixels; partial sums over fixed groups of images, added in order.
void conv_grad_w(const ConvSizes& sizes, const real* x, const real* gy, real* gw);

/// y [rows, cout] = f(bias + x [rows, cin] * w [cin, cout]), and its gradients.
void linear(Dim rows, Dim cin, Dim cout, const real* x, const real* w, const real* bias, real negative_slope,
            real* y);
void linear_grad_x(Dim rows, Dim cin, Dim cout, const real* gy, const real* w, Into into, real* gx);
void linear_grad_w(Dim rows, Dim cin, Dim cout, const real* x, const real* gy, real* gw);

/// gb [cout] += the sum of gy [rows, cout] over rows.
void bias_grad(Dim rows, Dim cout, const real* gy, real* gb);

}  // namespace supertac::kernels
