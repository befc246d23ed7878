#include "autograd/kernels/channels.h"

#include "autograd/kernels/clones.h"
#include "autograd/kernels/parallel.h"

namespace supertac::kernels {
namespace {

// Whole images to a piece, so that no sum crosses pieces.
template <class F>
void for_each_image(Dim images, Dim elements, F f) {
  const Dim piece = std::max<Dim>(1, kPieceElements / std::max<Dim>(elements, 1));
  for_pieces(
      images,
      [&](Dim begin, Dim end) {
        for (Dim n = begin; n < end; ++n) f(n);
      },
      piece);
}

SUPERTAC_CLONES void channel_mean_loop(Dim pixels, Dim channels, const real* from, real* __restrict mean) {
  std::fill_n(mean, channels, real(0));
  for (Dim p = 0; p < pixels; ++p, from += channels) {
    for (Dim c = 0; c < channels; ++c) mean[c] += from[c];
  }
  for (Dim c = 0; c < channels; ++c) mean[c] /= static_cast<real>(pixels);
}

SUPERTAC_CLONES void channel_mean_grad_loop(Dim pixels, Dim channels, const real* g, real* __restrict to) {
  for (Dim p = 0; p < pixels; ++p, to += channels) {
    for (Dim c = 0; c < channels; ++c) to[c] += g[c] / static_cast<real>(pixels);
  }
}

SUPERTAC_CLONES void scale_channels_loop(Dim pixels, Dim channels, const real* from, const real* gate,
                                         real* __restrict to) {
  for (Dim p = 0; p < pixels; ++p, from += channels, to += channels) {
    for (Dim c = 0; c < channels; ++c) to[c] = from[c] * gate[c];
  }
}

SUPERTAC_CLONES void scale_channels_grad_x_loop(Dim pixels, Dim channels, const real* g, const real* gate,
                                                real* __restrict to) {
  for (Dim p = 0; p < pixels; ++p, g += channels, to += channels) {
    for (Dim c = 0; c < channels; ++c) to[c] += g[c] * gate[c];
  }
}

SUPERTAC_CLONES void scale_channels_grad_s_loop(Dim pixels, Dim channels, const real* g, const real* from,
                                                real* __restrict to) {
  for (Dim p = 0; p < pixels; ++p, g += channels, from += channels) {
    for (Dim c = 0; c < channels; ++c) to[c] += g[c] * from[c];
  }
}

}  // namespace

void channel_mean(Dim images, Dim pixels, Dim channels, const real* x, real* y) {
  for_each_image(images, pixels * channels, [=](Dim n) {
    channel_mean_loop(pixels, channels, x + n * pixels * channels, y + n * channels);
  });
}

void channel_mean_grad(Dim images, Dim pixels, Dim channels, const real* gy, real* gx) {
  for_each_image(images, pixels * channels, [=](Dim n) {
    channel_mean_grad_loop(pixels, channels, gy + n * channels, gx + n * pixels * channels);
  });
}

void scale_channels(Dim images, Dim pixels, Dim channels, const real* x, const real* s, real* y) {
  for_each_image(images, pixels * channels, [=](Dim n) {
    scale_channels_loop(pixels, channels, x + n * pixels * channels, s + n * channels,
                        y + n * pixels * channels);
  });
}

void scale_channels_grad_x(Dim images, Dim pixels, Dim channels, const real* gy, const real* s, real* gx) {
  for_each_image(images, pixels * channels, [=](Dim n) {
    scale_channels_grad_x_loop(pixels, channels, gy + n * pixels * channels, s + n * channels,
                               gx + n * pixels * channels);
  });
}

void scale_channels_grad_s(Dim images, Dim pixels, Dim channels, const real* gy, const real* x, real* gs) {
  for_each_image(images, pixels * channels, [=](Dim n) {
    scale_channels_grad_s_loop(pixels, channels, gy + n * pixels * channels, x + n * pixels * channels,
                               gs + n * channels);
  });
}

}  // namespace supertac::kernels
