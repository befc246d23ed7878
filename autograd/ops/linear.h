// A linear layer: the op, and the matrix products that it consists of.
#pragma once

#include "autograd/ops/activations.h"

namespace supertac {

/// y = f(x w + b), f(s) = s for s > 0, else negative_slope s (kNoActivation: f(s) = s).  x [N,in], w
/// [in,out], b [out]; y [N,out]. Throws std::invalid_argument on other shapes and for a negative slope.
Variable linear(const Variable& x, const Variable& w, const Variable& b, real negative_slope = kNoActivation);

namespace kernels {

/// The same without a graph and without checks; y overlaps no input. x [rows, cin], w [cin, cout], y [rows,
/// cout]; bias [cout] may be null.
void linear(Dim rows, Dim cin, Dim cout, const real* x, const real* w, const real* bias, real negative_slope,
            real* y);
/// gx [rows, cin] = or += gy [rows, cout] w^T, as `into` says
void linear_grad_x(Dim rows, Dim cin, Dim cout, const real* gy, const real* w, Into into, real* gx);
/// gw [cin, cout] = or += x^T gy
void linear_grad_w(Dim rows, Dim cin, Dim cout, const real* x, const real* gy, Into into, real* gw);

}  // namespace kernels
}  // namespace supertac
