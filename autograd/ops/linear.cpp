#include "autograd/ops/linear.h"

#include <algorithm>
#include <cmath>

#include "autograd/kernels/fast/conv.h"
#include "autograd/kernels/fast/isa/isa.h"
#include "autograd/ops/elementwise.h"

namespace supertac {

// x [N,in], w [in,out], b [out], y [N,out] = f(x w + b)
// gs = gy f'(y)     gx = gs w^T     gw = x^T gs     gb = sum over rows gs
Variable linear(const Variable& x, const Variable& w, const Variable& b, real negative_slope) {
  check_rank("linear", "x", x, 2);
  check_rank("linear", "w", w, 2);
  const Dim rows = x.dim(0), in = w.dim(0), out = w.dim(1);
  if (x.dim(1) != in)
    refuse("linear", "x", std::to_string(in) + " columns, as w " + w.shape().text(), x.shape().text());
  check_shape("linear", "b", b, {out});
  check_slope("linear", negative_slope);
  Tensor y(Shape{rows, out});
  kernels::linear(rows, in, out, x.value().data(), w.value().data(), b.value().data(), negative_slope,
                  y.data());
  const auto reverse = [rows, in, out, negative_slope](Backward& g) {
    const real* gs = before_activation(g, negative_slope);
    if (const Backward::Slot gx = g.slot_of(0))
      kernels::linear_grad_x(rows, in, out, gs, g.value(1).data(), gx.into, gx.data());
    if (const Backward::Slot gw = g.slot_of(1))
      kernels::linear_grad_w(rows, in, out, g.value(0).data(), gs, gw.into, gw.data());
    if (const Backward::Slot gb = g.slot_of(2)) kernels::bias_grad(rows, out, gs, gb.into, gb.data());
  };
  const OpSettings settings{.negative_slope = negative_slope};
  return record("linear", y, {&x, &w, &b}, reverse, &settings);
}

// y[n,o] = f(bias[o] + sum over i of x[n,i] w[i,o])
void kernels::linear(Dim rows, Dim cin, Dim cout, const real* x, const real* w, const real* bias,
                     real negative_slope, real* y) {
  if (!kernels::is_plain()) return kernels::fast::linear(rows, cin, cout, x, w, bias, negative_slope, y);
  for (Dim n = 0; n < rows; ++n) {
    for (Dim o = 0; o < cout; ++o) {
      real sum = bias != nullptr ? bias[o] : 0;
      for (Dim i = 0; i < cin; ++i) sum = std::fma(x[n * cin + i], w[i * cout + o], sum);  // rounds once
      y[n * cout + o] = kernels::Rectifier(negative_slope)(sum);
    }
  }
}

// gx[n,i] = or += sum over o of gy[n,o] w[i,o]
void kernels::linear_grad_x(Dim rows, Dim cin, Dim cout, const real* gy, const real* w, Into into, real* gx) {
  if (!kernels::is_plain()) return kernels::fast::linear_grad_x(rows, cin, cout, gy, w, into, gx);
  for (Dim n = 0; n < rows; ++n) {
    for (Dim i = 0; i < cin; ++i) {
      real sum = into == Into::add ? gx[n * cin + i] : 0;
      for (Dim o = 0; o < cout; ++o) sum = std::fma(gy[n * cout + o], w[i * cout + o], sum);
      gx[n * cin + i] = sum;
    }
  }
}

// gw[i,o] = or += sum over n of x[n,i] gy[n,o]
void kernels::linear_grad_w(Dim rows, Dim cin, Dim cout, const real* x, const real* gy, Into into, real* gw) {
  if (!kernels::is_plain()) return kernels::fast::linear_grad_w(rows, cin, cout, x, gy, into, gw);
  if (into == Into::overwrite) std::fill_n(gw, cin * cout, real(0));
  for (Dim i = 0; i < cin; ++i) {
    for (Dim o = 0; o < cout; ++o) {
      for (Dim n = 0; n < rows; ++n) {
        gw[i * cout + o] = std::fma(x[n * cin + i], gy[n * cout + o], gw[i * cout + o]);
      }
    }
  }
}

}  // namespace supertac
