#include "autograd/ops/linear.h"

#include "autograd/checks.h"
#include "autograd/kernels/linear.h"
#include "autograd/trace.h"

namespace supertac {

// gs = gy f'(y)     gx = gs w^T     gw = x^T gs     gb = sum over rows gs
Variable linear(const Variable& x, const Variable& w, const Variable& b, real negative_slope) {
  check_rank("linear", "x", x, 2);
  check_rank("linear", "weight", w, 2);
  const Dim rows = x.dim(0), in = w.dim(0), out = w.dim(1);
  if (x.dim(1) != in) {
    refuse("linear", "weight expects " + std::to_string(in) + " inputs, x has " + std::to_string(x.dim(1)) +
                         " (x " + x.shape().text() + ", weight " + w.shape().text() + ")");
  }
  check_shape("linear", "bias", b, {out});
  check_slope("linear", negative_slope);
  Tensor y(Shape{rows, out});
  kernels::linear(rows, in, out, x.value().data(), w.value().data(), b.value().data(), negative_slope,
                  y.data());
  Trace::describe({.negative_slope = negative_slope});
  return record("linear", y, {&x, &w, &b}, [rows, in, out, negative_slope](Backward& g) {
    const real* gs = before_activation(g, negative_slope);
    if (const Backward::Slot gx = g.slot_of(0)) {
      kernels::linear_grad_x(rows, in, out, gs, g.value(1).data(), gx.into, gx.data());
    }
    if (const Backward::Slot gw = g.slot_of(1)) {
      kernels::linear_grad_w(rows, in, out, g.value(0).data(), gs, gw.into, gw.data());
    }
    if (const Backward::Slot gb = g.slot_of(2)) kernels::bias_grad(rows, out, gs, gb.into, gb.data());
  });
}

}  // namespace supertac
