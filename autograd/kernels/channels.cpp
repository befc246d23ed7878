#include "autograd/kernels/channels.h"

#include <algorithm>

#include "autograd/kernels/fast/loops.h"

namespace supertac::kernels {

void channel_mean(Dim images, Dim pixels, Dim channels, const real* from, real* __restrict mean) {
  run_loop([=]() mutable SUPERTAC_LOOP {
    for (Dim n = 0; n < images; ++n, mean += channels) {
      std::fill_n(mean, channels, real(0));
      for (Dim p = 0; p < pixels; ++p, from += channels) {
        for (Dim c = 0; c < channels; ++c) mean[c] += from[c];
      }
      for (Dim c = 0; c < channels; ++c) mean[c] /= static_cast<real>(pixels);
    }
  });
}

void channel_mean_grad(Dim images, Dim pixels, Dim channels, const real* g, real* __restrict to) {
  run_loop([=]() mutable SUPERTAC_LOOP {
    for (Dim n = 0; n < images; ++n, g += channels) {
      for (Dim p = 0; p < pixels; ++p, to += channels) {
        for (Dim c = 0; c < channels; ++c) to[c] += g[c] / static_cast<real>(pixels);
      }
    }
  });
}

void gated_sum(Dim images, Dim pixels, Dim channels, const real* a, const real* from, const real* gate,
               real* __restrict to) {
  run_loop([=]() mutable SUPERTAC_LOOP {
    for (Dim n = 0; n < images; ++n, gate += channels) {
      for (Dim p = 0; p < pixels; ++p, a += channels, from += channels, to += channels) {
        for (Dim c = 0; c < channels; ++c) to[c] = a[c] + from[c] * gate[c];
      }
    }
  });
}

static void scale_channels(Dim images, Dim pixels, Dim channels, const real* from, const real* gate,
                           real* __restrict to) {
  run_loop([=]() mutable SUPERTAC_LOOP {
    for (Dim n = 0; n < images; ++n, gate += channels) {
      for (Dim p = 0; p < pixels; ++p, from += channels, to += channels) {
        for (Dim c = 0; c < channels; ++c) to[c] = from[c] * gate[c];
      }
    }
  });
}

static void add_scaled_channels(Dim images, Dim pixels, Dim channels, const real* g, const real* gate,
                                real* __restrict to) {
  run_loop([=]() mutable SUPERTAC_LOOP {
    for (Dim n = 0; n < images; ++n, gate += channels) {
      for (Dim p = 0; p < pixels; ++p, g += channels, to += channels) {
        for (Dim c = 0; c < channels; ++c) to[c] += g[c] * gate[c];
      }
    }
  });
}

void gated_sum_grad_x(Dim images, Dim pixels, Dim channels, const real* g, const real* gate, Into into,
                      real* to) {
  if (into == Into::add) return add_scaled_channels(images, pixels, channels, g, gate, to);
  scale_channels(images, pixels, channels, g, gate, to);
}

void gated_sum_grad_s(Dim images, Dim pixels, Dim channels, const real* g, const real* from,
                      real* __restrict to) {
  run_loop([=]() mutable SUPERTAC_LOOP {
    for (Dim n = 0; n < images; ++n, to += channels) {
      for (Dim p = 0; p < pixels; ++p, g += channels, from += channels) {
        for (Dim c = 0; c < channels; ++c) to[c] += g[c] * from[c];
      }
    }
  });
}

}  // namespace supertac::kernels
