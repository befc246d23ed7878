#include "autograd/kernels/channels.h"

#include <algorithm>

#include "autograd/kernels/fast/loops.h"

namespace supertac::kernels {
namespace {

// Calls body(i, k) for each element i of [images, pixels, channels] and the k of its image and channel in
// [images, channels].
template <class Body>
void each_element(Dim images, Dim pixels, Dim channels, Body body) {
  run_loop([=]() SUPERTAC_LOOP {
    for (Dim n = 0, pixel = 0; n < images; ++n) {
      for (Dim p = 0; p < pixels; ++p, pixel += channels) {
        SUPERTAC_INDEPENDENT
        for (Dim c = 0; c < channels; ++c) body(pixel + c, n * channels + c);
      }
    }
  });
}

}  // namespace

void channel_mean(Dim images, Dim pixels, Dim channels, const real* x, real* mean) {
  std::fill_n(mean, images * channels, real(0));
  each_element(images, pixels, channels, [=](Dim i, Dim k) SUPERTAC_LOOP { mean[k] += x[i]; });
  each(images * channels, [=](Dim k) SUPERTAC_LOOP { mean[k] /= static_cast<real>(pixels); });
}

void channel_mean_grad(Dim images, Dim pixels, Dim channels, const real* g, real* gx) {
  each_element(images, pixels, channels,
               [=](Dim i, Dim k) SUPERTAC_LOOP { gx[i] += g[k] / static_cast<real>(pixels); });
}

void gated_sum(Dim images, Dim pixels, Dim channels, const real* a, const real* x, const real* gate,
               real* y) {
  each_element(images, pixels, channels, [=](Dim i, Dim k) SUPERTAC_LOOP { y[i] = a[i] + x[i] * gate[k]; });
}

void gated_sum_grad_x(Dim images, Dim pixels, Dim channels, const real* gy, const real* gate, Into into,
                      real* gx) {
  if (into == Into::add) {
    each_element(images, pixels, channels, [=](Dim i, Dim k) SUPERTAC_LOOP { gx[i] += gy[i] * gate[k]; });
  } else {
    each_element(images, pixels, channels, [=](Dim i, Dim k) SUPERTAC_LOOP { gx[i] = gy[i] * gate[k]; });
  }
}

void gated_sum_grad_s(Dim images, Dim pixels, Dim channels, const real* gy, const real* x, real* gs) {
  each_element(images, pixels, channels, [=](Dim i, Dim k) SUPERTAC_LOOP { gs[k] += gy[i] * x[i]; });
}

}  // namespace supertac::kernels
