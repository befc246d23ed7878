#include "autograd/ops/linear.h"

#include "autograd/checks.h"
#include "autograd/kernels/conv.h"

namespace supertac {

// gx = gy w^T     gw = x^T gy     gb = sum over rows gy
Variable linear(const Variable& x, const Variable& w, const Variable& b) {
  check_rank("linear", "x", x, 2);
  check_rank("linear", "weight", w, 2);
  const Dim rows = x.dim(0), in = w.dim(0), out = w.dim(1);
  if (x.dim(1) != in) {
    refuse("linear", "weight expects " + std::to_string(in) + " inputs, x has " + std::to_string(x.dim(1)) +
                         " (x " + x.shape().text() + ", weight " + w.shape().text() + ")");
  }
  check_shape("linear", "bias", b, {out});
  Tensor y(Shape{rows, out});
  kernels::linear(rows, in, out, x.value().data(), w.value().data(), b.value().data(), y.data());
  return record("linear", y, {&x, &w, &b}, [rows, in, out](Backward& g) {
    const real* gy = g.gy().data();
    if (Tensor* gx = g.grad_of(0)) kernels::linear_grad_x(rows, in, out, gy, g.value(1).data(), gx->data());
    if (Tensor* gw = g.grad_of(1)) kernels::linear_grad_w(rows, in, out, g.value(0).data(), gy, gw->data());
    if (Tensor* gb = g.grad_of(2)) kernels::bias_grad(rows, out, gy, gb->data());
  });
}

}  // namespace supertac
