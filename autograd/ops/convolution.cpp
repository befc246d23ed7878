#include "autograd/ops/convolution.h"

#include "autograd/kernels/conv.h"
#include "autograd/ops/elementwise.h"

namespace supertac {
namespace {

using kernels::ConvSettings;
using kernels::ConvSizes;

constexpr Dim kMostPixels = 4096;  // of a stride, and of a margin

void check_arguments(const char* op, const Variable& x, const Variable& w, const Variable& b,
                     const ConvOptions& o, int rank) {
  check_rank(op, "x", x, rank);
  check_rank(op, "w", w, rank);
  const Dim in = w.dim(rank - 2), out = w.dim(rank - 1);
  if (x.dim(rank - 1) != in)
    refuse(op, "x", std::to_string(in) + " channels, as w " + w.shape().text(), x.shape().text());
  if (in < 1 || in > kernels::kMaxChannels || out < 1 || out > kernels::kMaxChannels)
    refuse(op, "w", "1 to " + std::to_string(kernels::kMaxChannels) + " channels", w.shape().text());
  if (w.dim(0) < 1 || w.dim(rank - 3) < 1) refuse(op, "w", "a kernel of 1 or more", w.shape().text());
  check_shape(op, "b", b, {out});
  check_slope(op, o.negative_slope);
  check_between(op, "stride", o.stride, 1, kMostPixels);
  check_between(op, "padding", o.padding, 0, kMostPixels);
}

ConvSettings settings_of(const Variable& x, const Variable& w, const ConvOptions& o, bool transposed) {
  const bool flat = x.rank() == 3;
  return {.height = flat ? 1 : x.dim(1),
          .width = x.dim(flat ? 1 : 2),
          .kernel_h = flat ? 1 : w.dim(0),
          .kernel_w = w.dim(flat ? 0 : 1),
          .stride_h = flat ? 1 : o.stride,
          .stride_w = o.stride,
          .padding_h = flat ? 0 : o.padding,
          .padding_w = o.padding,
          .transposed = transposed};
}

// Both conv and transposed conv: only the geometry differs.
//   x [N,H,W,in], w [taps...,in,out], b [out], y [N,H',W',out]; in one dimension without H
//   gs = gy f'(s)     gx = transpose(conv)(gs)     gw[t] = sum over pixels x^T gs     gb = sum over pixels gs
Variable convolve(const char* op, const Variable& x, const Variable& w, const Variable& b,
                  const ConvOptions& o, int rank, bool transposed) {
  check_arguments(op, x, w, b, o, rank);
  const ConvSettings s = settings_of(x, w, o, transposed);
  // How far the kernel can move in x, in pixels: a division by the stride would round -1 to an output of one.
  const Dim room_h = s.height + 2 * s.padding_h - s.kernel_h, room_w = s.width + 2 * s.padding_w - s.kernel_w;
  const bool empty = transposed ? s.out_height() < 1 || s.out_width() < 1 : room_h < 0 || room_w < 0;
  if (empty || s.height < 1 || s.width < 1)
    refuse(op, "x",
           "pixels for an output of 1 or more with w " + w.shape().text() + ", stride " +
               std::to_string(o.stride) + " and padding " + std::to_string(o.padding),
           x.shape().text());
  const ConvSizes sizes{s, x.dim(0), w.dim(rank - 2), w.dim(rank - 1)};
  Tensor y(rank == 3 ? Shape{x.dim(0), s.out_width(), sizes.cout}
                     : Shape{x.dim(0), s.out_height(), s.out_width(), sizes.cout});
  kernels::conv(sizes, x.value().data(), w.value().data(), b.value().data(), o.negative_slope, y.data());
  const auto reverse = [sizes, slope = o.negative_slope](Backward& g) {
    const real* gs = before_activation(g, slope);
    kernels::conv_grad_x(sizes, gs, g.value(1).data(), g.slot_of(0));
    kernels::conv_grad_w(sizes, g.value(0).data(), gs, g.slot_of(1));
    kernels::bias_grad(sizes.images * sizes.out_pixels(), sizes.cout, gs, g.slot_of(2));
  };
  const OpSettings settings{.conv = s, .negative_slope = o.negative_slope};
  return record(op, y, {&x, &w, &b}, reverse, &settings);
}

}  // namespace

Variable conv1d(const Variable& x, const Variable& w, const Variable& b, const ConvOptions& options) {
  return convolve("conv1d", x, w, b, options, 3, false);
}
Variable conv2d(const Variable& x, const Variable& w, const Variable& b, const ConvOptions& options) {
  return convolve("conv2d", x, w, b, options, 4, false);
}
Variable conv_transpose1d(const Variable& x, const Variable& w, const Variable& b,
                          const ConvOptions& options) {
  return convolve("conv_transpose1d", x, w, b, options, 3, true);
}
Variable conv_transpose2d(const Variable& x, const Variable& w, const Variable& b,
                          const ConvOptions& options) {
  return convolve("conv_transpose2d", x, w, b, options, 4, true);
}

}  // namespace supertac
