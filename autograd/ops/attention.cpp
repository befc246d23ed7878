#include "autograd/ops/attention.h"

#include "autograd/ops/elementwise.h"

namespace supertac {
namespace {

struct Maps {
  Dim images, pixels, channels;
};

// Calls body(i, k) for each element i of [images, pixels, channels] and the k of its image and channel in
// [images, channels].
template <class Body>
void each_element(const Maps& maps, Body body) {
  kernels::run_loop([maps, body] {
    const Dim channels = maps.channels;
    for (Dim n = 0, pixel = 0; n < maps.images; ++n) {
      for (Dim p = 0; p < maps.pixels; ++p, pixel += channels)
        kernels::each_here(channels, [=](Dim c) { body(pixel + c, n * channels + c); });
    }
  });
}

// gx[i] += term(i, k), with those i and k.
template <class Term>
void add_to_maps(const Backward::Slot& gx, const Maps& maps, Term term) {
  if (!gx) return;
  real* const to = gx.data();
  gx.into == Into::add ? each_element(maps, [=](Dim i, Dim k) { to[i] += term(i, k); })
                       : each_element(maps, [=](Dim i, Dim k) { to[i] = term(i, k); });
}

Maps maps_of(const char* op, const Variable& x) {
  check_rank(op, "x", x, 4);
  return {x.dim(0), x.dim(1) * x.dim(2), x.dim(3)};
}

}  // namespace

// x [N,H,W,C], y [N,C] = mean over h, w;  gx[n,h,w,c] = gy[n,c] / (H W)
Variable global_mean(const Variable& x) {
  const Maps maps = maps_of("global_mean", x);
  if (maps.pixels == 0) refuse("global_mean", "x", "a pixel or more", x.shape().text());
  const auto pixels = static_cast<real>(maps.pixels);
  Tensor y = Tensor::zeros({maps.images, maps.channels});
  real* const mean = y.data();
  each_element(maps, [=, from = x.value().data()](Dim i, Dim k) { mean[k] += from[i]; });
  each(y.size(), [=](Dim k) { mean[k] /= pixels; });
  return record("global_mean", y, {&x}, [maps, pixels](Backward& g) {
    add_to_maps(g.slot_of(0), maps, [pixels, gy = g.gy().data()](Dim, Dim k) { return gy[k] / pixels; });
  });
}

// a, x, y [N,H,W,C], s [N,C];  y = a + x s
// ga = gy     gx = gy s     gs[n,c] = sum over h, w of gy x
Variable gated_sum(const Variable& a, const Variable& x, const Variable& s) {
  const Maps maps = maps_of("gated_sum", x);
  check_same_shape("gated_sum", "a", a, "x", x);
  check_shape("gated_sum", "s", s, {x.dim(0), x.dim(3)});
  Tensor y(x.shape());
  each_element(maps, [to = y.data(), a = a.value().data(), x = x.value().data(), s = s.value().data()](
                         Dim i, Dim k) { to[i] = a[i] + x[i] * s[k]; });
  return record("gated_sum", y, {&a, &x, &s}, [maps](Backward& g) {
    const real *gy = g.gy().data(), *from = g.value(1).data(), *gate = g.value(2).data();
    add_to_gradient(g, 0, [=](Dim i) { return gy[i]; });
    add_to_maps(g.slot_of(1), maps, [=](Dim i, Dim k) { return gy[i] * gate[k]; });
    if (Tensor* gs = g.grad_of(2))
      each_element(maps, [=, to = gs->data()](Dim i, Dim k) { to[k] += gy[i] * from[i]; });
  });
}

}  // namespace supertac
