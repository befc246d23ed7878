#include "autograd/ops/linear.h"

#include "autograd/kernels/conv.h"
#include "autograd/ops/elementwise.h"

namespace supertac {

// x [N,in], w [in,out], b [out], s [N,out] = x w + b, y = f(s)
// gs = gy f'(s)     gx = gs w^T     gw = x^T gs     gb = sum over rows gs
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
    kernels::linear_grad_x(rows, in, out, gs, g.value(1).data(), g.slot_of(0));
    kernels::linear_grad_w(rows, in, out, g.value(0).data(), gs, g.slot_of(1));
    kernels::bias_grad(rows, out, gs, g.slot_of(2));
  };
  const OpSettings settings{.negative_slope = negative_slope};
  return record("linear", y, {&x, &w, &b}, reverse, &settings);
}

}  // namespace supertac
