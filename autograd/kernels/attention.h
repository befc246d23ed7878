// What a block with channel attention does to its maps, callable without a graph. Here x, a, y and their
// gradients are [images, pixels, channels]; means, s and theirs are [images, channels].
#pragma once

#include <algorithm>

#include "autograd/kernels/fast/each.h"

namespace supertac::kernels {

struct Maps {
  Dim images, pixels, channels;
};

/// Calls body(i, k) for each i of [images, pixels, channels] and the k of its image and channel in [images,
/// channels].
template <class Body>
void each_element(const Maps& maps, Body body) {
  run_loop([maps, body] {
    const Dim channels = maps.channels;
    for (Dim n = 0, pixel = 0; n < maps.images; ++n) {
      for (Dim p = 0; p < maps.pixels; ++p, pixel += channels)
        each_here(channels, [=](Dim c) { body(pixel + c, n * channels + c); });
    }
  });
}

/// gx[i] = or += term(i, k), with those i and k.
template <class Term>
void each_element_into(const Maps& maps, Slot gx, Term term) {
  write_into(gx, [=](auto put) { each_element(maps, [=](Dim i, Dim k) { put(i, term(i, k)); }); });
}

/// mean = the mean over pixels of x
inline void global_mean(const Maps& maps, const real* x, real* mean) {
  const Dim means = maps.images * maps.channels;
  std::fill_n(mean, means, real(0));
  each_element(maps, [=](Dim i, Dim k) { mean[k] += x[i]; });
  each(means, [=, pixels = static_cast<real>(maps.pixels)](Dim k) { mean[k] /= pixels; });
}
/// gx = gy / pixels
inline void global_mean_grad(const Maps& maps, const real* gy, Slot gx) {
  each_element_into(maps, gx,
                    [gy, pixels = static_cast<real>(maps.pixels)](Dim, Dim k) { return gy[k] / pixels; });
}

/// y = a + x s
inline void gated_sum(const Maps& maps, const real* a, const real* x, const real* s, real* y) {
  each_element(maps, [=](Dim i, Dim k) { y[i] = a[i] + x[i] * s[k]; });
}
/// ga = gy,  gx = gy s,  gs = the sum over pixels of gy x
inline void gated_sum_grad(const Maps& maps, const real* gy, const real* x, const real* s, Slot ga, Slot gx,
                           Slot gs) {
  each_into(maps.images * maps.pixels * maps.channels, ga, [=](Dim i) { return gy[i]; });
  each_element_into(maps, gx, [=](Dim i, Dim k) { return gy[i] * s[k]; });
  if (!gs) return;
  gs.begin(maps.images * maps.channels);
  each_element(maps, [=, to = gs.data](Dim i, Dim k) { to[k] += gy[i] * x[i]; });
}

}  // namespace supertac::kernels
