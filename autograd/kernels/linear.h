// The matrix products of a linear layer, callable without a graph. x [rows, cin], w [cin, cout], y [rows,
// cout].
#pragma once

#include "autograd/tensor.h"

namespace supertac::kernels {

/// y = f(bias [cout] + x w), f(s) = s for s > 0, else negative_slope * s; bias may be null.
void linear(Dim rows, Dim cin, Dim cout, const real* x, const real* w, const real* bias, real negative_slope,
            real* y);
/// gx = or += gy w^T
void linear_grad_x(Dim rows, Dim cin, Dim cout, const real* gy, const real* w, Into into, real* gx);
/// gw = or += x^T gy
void linear_grad_w(Dim rows, Dim cin, Dim cout, const real* x, const real* gy, Into into, real* gw);
/// A sum over rows runs over this many before it is added to the total.
inline constexpr Dim kRowsPerPiece = 256;
/// gb [cout] = or += the sum of gy over rows; of a convolution the rows are the pixels of all images.
void bias_grad(Dim rows, Dim cout, const real* gy, Into into, real* gb);

}  // namespace supertac::kernels
