#include "autograd/ops/activations.h"

#include "autograd/checks.h"
#include "autograd/kernels/elementwise.h"

namespace supertac {
namespace {

Variable rectify(const char* op, const Variable& x, real slope) {
  Tensor y(x.shape());
  kernels::leaky_relu(x.size(), slope, x.value().data(), y.data());
  return record(op, y, {&x}, [slope](Backward& b) {
    if (Tensor* gx = b.grad_of(0)) {
      kernels::leaky_relu_grad(gx->size(), slope, b.gy().data(), b.y().data(), gx->data());
    }
  });
}

}  // namespace

Variable relu(const Variable& x) { return rectify("relu", x, 0); }

Variable leaky_relu(const Variable& x, real slope) {
  check_slope("leaky_relu", slope);
  return rectify("leaky_relu", x, slope);
}

void check_slope(const char* op, real slope) {
  if (!(slope >= 0)) refuse(op, "slope must not be negative, got " + std::to_string(slope));
}

// y and s have the same sign
const real* before_activation(Backward& b, real slope) {
  Tensor& g = b.mutable_gy();
  if (slope != kNoActivation) kernels::rectify_in_place(g.size(), slope, b.y().data(), g.data());
  return g.data();
}

// gx = gy y (1 - y)
Variable sigmoid(const Variable& x) {
  Tensor y(x.shape());
  kernels::sigmoid(x.size(), x.value().data(), y.data());
  return record("sigmoid", y, {&x}, [](Backward& b) {
    if (Tensor* gx = b.grad_of(0)) kernels::sigmoid_grad(gx->size(), b.gy().data(), b.y().data(), gx->data());
  });
}

Variable clamp(const Variable& x, real low, real high) {
  if (!(low <= high))
    refuse("clamp", "low must not exceed high, got " + std::to_string(low) + " and " + std::to_string(high));
  Tensor y(x.shape());
  kernels::clamp(x.size(), low, high, x.value().data(), y.data());
  return record("clamp", y, {&x}, [low, high](Backward& b) {
    if (Tensor* gx = b.grad_of(0)) {
      kernels::clamp_grad(gx->size(), low, high, b.gy().data(), b.value(0).data(), gx->data());
    }
  });
}

}  // namespace supertac
