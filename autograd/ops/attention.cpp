#include "autograd/ops/attention.h"

#include "autograd/checks.h"
#include "autograd/kernels/channels.h"

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

// gx = gy s     gs[n,c] = sum over h, w of gy x
Variable scale_channels(const Variable& x, const Variable& s) {
  check_rank("scale_channels", "x", x, 4);
  check_shape("scale_channels", "s", s, {x.dim(0), x.dim(3)});
  const Dim images = x.dim(0), pixels = x.dim(1) * x.dim(2), channels = x.dim(3);
  Tensor y(x.shape());
  kernels::scale_channels(images, pixels, channels, x.value().data(), s.value().data(), y.data());
  return record("scale_channels", y, {&x, &s}, [=](Backward& b) {
    const real* gy = b.gy().data();
    if (const Backward::Slot gx = b.slot_of(0)) {
      kernels::scale_channels_grad_x(images, pixels, channels, gy, b.value(1).data(), gx.into, gx.data());
    }
    if (Tensor* gs = b.grad_of(1)) {
      kernels::scale_channels_grad_s(images, pixels, channels, gy, b.value(0).data(), gs->data());
    }
  });
}

}  // namespace supertac
