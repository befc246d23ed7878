#include "autograd/ops/attention.h"

#include "autograd/checks.h"
#include "autograd/kernels/channels.h"
#include "autograd/kernels/elementwise.h"

namespace supertac {

// gx[n,h,w,c] = gs[n,c] / (H W)
Variable global_mean(const Variable& x) {
  check_rank("global_mean", "x", x, 4);
  const Dim images = x.dim(0), pixels = x.dim(1) * x.dim(2), channels = x.dim(3);
  if (pixels == 0) refuse("global_mean", "x has no pixels: " + x.shape().text());
  Tensor y(Shape{images, channels});
  kernels::channel_mean(images, pixels, channels, x.value().data(), y.data());
  return record("global_mean", y, {&x}, [=](Backward& b) {
    if (Tensor* gx = b.grad_of(0)) {
      kernels::channel_mean_grad(images, pixels, channels, b.gy().data(), gx->data());
    }
  });
}

// ga = gy     gx = gy s     gs[n,c] = sum over h, w of gy x
Variable gated_sum(const Variable& a, const Variable& x, const Variable& s) {
  check_rank("gated_sum", "x", x, 4);
  check_same_shape("gated_sum", "a", a, "x", x);
  check_shape("gated_sum", "s", s, {x.dim(0), x.dim(3)});
  const Dim images = x.dim(0), pixels = x.dim(1) * x.dim(2), channels = x.dim(3);
  Tensor y(x.shape());
  kernels::gated_sum(images, pixels, channels, a.value().data(), x.value().data(), s.value().data(),
                     y.data());
  return record("gated_sum", y, {&a, &x, &s}, [=](Backward& b) {
    const real* gy = b.gy().data();
    if (const Backward::Slot ga = b.slot_of(0)) kernels::put(b.gy().size(), gy, ga.into, ga.data());
    if (const Backward::Slot gx = b.slot_of(1)) {
      kernels::gated_sum_grad_x(images, pixels, channels, gy, b.value(2).data(), gx.into, gx.data());
    }
    if (Tensor* gs = b.grad_of(2)) {
      kernels::gated_sum_grad_s(images, pixels, channels, gy, b.value(1).data(), gs->data());
    }
  });
}

}  // namespace supertac
