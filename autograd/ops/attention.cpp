#include "autograd/ops/attention.h"

#include "autograd/kernels/attention.h"
#include "autograd/record.h"

namespace supertac {

static kernels::Maps maps_of(const char* op, const Variable& x) {
  check_rank(op, "x", x, 4);
  return {x.dim(0), x.dim(1) * x.dim(2), x.dim(3)};
}

// x [N,H,W,C], y [N,C] = mean over h, w;  gx[n,h,w,c] = gy[n,c] / (H W)
Variable global_mean(const Variable& x) {
  const kernels::Maps maps = maps_of("global_mean", x);
  if (maps.pixels == 0) refuse("global_mean", "x", "a pixel or more", x.shape().text());
  Tensor y(Shape{maps.images, maps.channels});
  kernels::global_mean(maps, x.value().data(), y.data());
  return record("global_mean", y, {&x},
                [maps](Backward& g) { kernels::global_mean_grad(maps, g.gy().data(), g.slot_of(0)); });
}

// a, x, y [N,H,W,C], s [N,C];  y = a + x s
// ga = gy     gx = gy s     gs[n,c] = sum over h, w of gy x
Variable gated_sum(const Variable& a, const Variable& x, const Variable& s) {
  const kernels::Maps maps = maps_of("gated_sum", x);
  check_same_shape("gated_sum", "x", x, "a", a);
  check_shape("gated_sum", "s", s, {x.dim(0), x.dim(3)});
  Tensor y(x.shape());
  kernels::gated_sum(maps, a.value().data(), x.value().data(), s.value().data(), y.data());
  return record("gated_sum", y, {&a, &x, &s}, [maps](Backward& g) {
    const Slot ga = g.slot_of(0), gx = g.slot_of(1), gs = g.slot_of(2);
    kernels::gated_sum_grad(maps, g.gy().data(), g.value(1).data(), g.value(2).data(), ga, gx, gs);
  });
}

}  // namespace supertac
