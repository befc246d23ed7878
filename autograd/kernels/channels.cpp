#include "autograd/kernels/channels.h"

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

}  // namespace

void channel_mean(Dim images, Dim pixels, Dim channels, const real* x, real* y) {
  for_each_image(images, pixels * channels, [=](Dim n) {
    real* __restrict mean = y + n * channels;
    const real* from = x + n * pixels * channels;
    std::fill_n(mean, channels, real(0));
    for (Dim p = 0; p < pixels; ++p, from += channels) {
      for (Dim c = 0; c < channels; ++c) mean[c] += from[c];
    }
    for (Dim c = 0; c < channels; ++c) mean[c] /= static_cast<real>(pixels);
  });
}

void channel_mean_grad(Dim images, Dim pixels, Dim channels, const real* gy, real* gx) {
  for_each_image(images, pixels * channels, [=](Dim n) {
    const real* g = gy + n * channels;
    real* __restrict to = gx + n * pixels * channels;
    for (Dim p = 0; p < pixels; ++p, to += channels) {
      for (Dim c = 0; c < channels; ++c) to[c] += g[c] / static_cast<real>(pixels);
    }
  });
}

void scale_channels(Dim images, Dim pixels, Dim channels, const real* x, const real* s, real* y) {
  for_each_image(images, pixels * channels, [=](Dim n) {
    const real* gate = s + n * channels;
    const real* from = x + n * pixels * channels;
    real* __restrict to = y + n * pixels * channels;
    for (Dim p = 0; p < pixels; ++p, from += channels, to += channels) {
      for (Dim c = 0; c < channels; ++c) to[c] = from[c] * gate[c];
    }
  });
}

void scale_channels_grad_x(Dim images, Dim pixels, Dim channels, const real* gy, const real* s, real* gx) {
  for_each_image(images, pixels * channels, [=](Dim n) {
    const real* gate = s + n * channels;
    const real* g = gy + n * pixels * channels;
    real* __restrict to = gx + n * pixels * channels;
    for (Dim p = 0; p < pixels; ++p, g += channels, to += channels) {
      for (Dim c = 0; c < channels; ++c) to[c] += g[c] * gate[c];
    }
  });
}

void scale_channels_grad_s(Dim images, Dim pixels, Dim channels, const real* gy, const real* x, real* gs) {
  for_each_image(images, pixels * channels, [=](Dim n) {
    const real* g = gy + n * pixels * channels;
    const real* from = x + n * pixels * channels;
    real* __restrict to = gs + n * channels;
    for (Dim p = 0; p < pixels; ++p, g += channels, from += channels) {
      for (Dim c = 0; c < channels; ++c) to[c] += g[c] * from[c];
    }
  });
}

}  // namespace supertac::kernels
