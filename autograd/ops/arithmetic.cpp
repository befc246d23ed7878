#include "autograd/ops/arithmetic.h"

#include "autograd/checks.h"
#include "autograd/kernels/elementwise.h"

namespace supertac {

// ga = gb = gy
Variable add(const Variable& a, const Variable& b) {
  check_same_shape("add", "a", a, "b", b);
  Tensor y(a.shape());
  kernels::add(y.size(), a.value().data(), b.value().data(), y.data());
  return record("add", y, {&a, &b}, [](Backward& g) {
    for (const std::size_t i : {0, 1}) {
      if (const Backward::Slot gx = g.slot_of(i))
        kernels::put(gx.grad->size(), g.gy().data(), gx.into, gx.data());
    }
  });
}

// ga = gy b,  gb = gy a
Variable multiply(const Variable& a, const Variable& b) {
  check_same_shape("multiply", "a", a, "b", b);
  Tensor y(a.shape());
  kernels::multiply(y.size(), a.value().data(), b.value().data(), y.data());
  return record("multiply", y, {&a, &b}, [](Backward& g) {
    if (Tensor* ga = g.grad_of(0)) {
      kernels::add_product(ga->size(), g.gy().data(), g.value(1).data(), ga->data());
    }
    if (Tensor* gb = g.grad_of(1)) {
      kernels::add_product(gb->size(), g.gy().data(), g.value(0).data(), gb->data());
    }
  });
}

// gx = factor gy
Variable scale(const Variable& x, real factor) {
  Tensor y(x.shape());
  kernels::scale(y.size(), factor, x.value().data(), y.data());
  return record("scale", y, {&x}, [factor](Backward& b) {
    if (Tensor* gx = b.grad_of(0)) kernels::add_scaled(gx->size(), factor, b.gy().data(), gx->data());
  });
}

// gx = gy, everywhere
Variable sum(const Variable& x) {
  const auto total = static_cast<real>(kernels::sum(x.size(), x.value().data()));
  return record("sum", Tensor::full({}, total), {&x}, [](Backward& b) {
    if (Tensor* gx = b.grad_of(0)) kernels::add_constant(gx->size(), b.gy().item(), gx->data());
  });
}

}  // namespace supertac
