#include "autograd/ops/attention.h"

#include "autograd/ops/elementwise.h"

namespace supertac {
namespace {

struct Maps {
  Dim images, pixels, channels;
};

Maps maps_of(const char* op, const Variable& x) {
  check_rank(op, "x", x, 4);
  return {x.dim(0), x.dim(1) * x.dim(2), x.dim(3)};
}

// Calls body(i, k) for each i of [images, pixels, channels] and the k of its image and channel in [images,
// channels].
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

// gx[i] = or += term(i, k), with those i and k.
template <class Term>
void each_element_into(const Maps& maps, Slot gx, Term term) {
  kernels::write_into(gx, [=](auto put) { each_element(maps, [=](Dim i, Dim k) { put(i, term(i, k)); }); });
}

}  // namespace

// x [N,H,W,C], y [N,C] = mean over h, w;  gx[n,h,w,c] = gy[n,c] / (H W)
Variable global_mean(const Variable& x) {
  const Maps maps = maps_of("global_mean", x);
  if (maps.pixels == 0) refuse("global_mean", "x", "a pixel or more", x.shape().text());
  const auto pixels = static_cast<real>(maps.pixels);
  Tensor y = Tensor::zeros({maps.images, maps.channels});
  each_element(maps, [from = x.value().data(), to = y.data()](Dim i, Dim k) { to[k] += from[i]; });
  each(y.size(), [to = y.data(), pixels](Dim k) { to[k] /= pixels; });
  return record("global_mean", y, {&x}, [maps, pixels](Backward& g) {
    each_element_into(maps, g.slot_of(0),
                      [gy = g.gy().data(), pixels](Dim, Dim k) { return gy[k] / pixels; });
  });
}

// a, x, y [N,H,W,C], s [N,C];  y = a + x s
// ga = gy     gx = gy s     gs[n,c] = sum over h, w of gy x
Variable gated_sum(const Variable& a, const Variable& x, const Variable& s) {
  const Maps maps = maps_of("gated_sum", x);
  check_same_shape("gated_sum", "x", x, "a", a);
  check_shape("gated_sum", "s", s, {x.dim(0), x.dim(3)});
  Tensor y(x.shape());
  each_element(maps, [start = a.value().data(), from = x.value().data(), gate = s.value().data(),
                      to = y.data()](Dim i, Dim k) { to[i] = start[i] + from[i] * gate[k]; });
  return record("gated_sum", y, {&a, &x, &s}, [maps](Backward& g) {
    const real *gy = g.gy().data(), *from = g.value(1).data(), *gate = g.value(2).data();
    add_to_gradient(g, 0, [=](Dim i) { return gy[i]; });
    each_element_into(maps, g.slot_of(1), [=](Dim i, Dim k) { return gy[i] * gate[k]; });
    const Slot gs = g.slot_of(2);
    if (!gs) return;
    gs.begin(maps.images * maps.channels);
    each_element(maps, [=, to = gs.data](Dim i, Dim k) { to[k] += gy[i] * from[i]; });
  });
}

}  // namespace supertac
