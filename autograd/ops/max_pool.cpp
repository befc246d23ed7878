#include "autograd/ops/max_pool.h"

#include "autograd/checks.h"
#include "autograd/kernels/max_pool.h"

namespace supertac {

// gx[where the largest was] = gy
Variable max_pool2d(const Variable& x) {
  check_rank("max_pool2d", "x", x, 4);
  if (x.dim(1) < 2 || x.dim(2) < 2) refuse("max_pool2d", "x must be at least 2x2, got " + x.shape().text());
  Tensor y(Shape{x.dim(0), x.dim(1) / 2, x.dim(2) / 2, x.dim(3)});
  kernels::max_pool(x.shape(), x.value().data(), y.data());
  return record("max_pool2d", y, {&x}, [](Backward& b) {
    if (Tensor* gx = b.grad_of(0)) {
      kernels::max_pool_grad(gx->shape(), b.value(0).data(), b.gy().data(), gx->data());
    }
  });
}

}  // namespace supertac
