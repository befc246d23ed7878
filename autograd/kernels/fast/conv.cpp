#include "autograd/kernels/fast/conv.h"

#include <algorithm>

#include "autograd/kernels/fast/isa/isa.h"

namespace supertac::kernels::fast {
namespace {

const ConvSettings kOnePixel{};  // of a linear layer, whose rows are images

void gather_batch(const GatherJob& job, Dim images, Dim in_pixels, Dim out_pixels, const real* x, real* y) {
  const auto gather = isa_kernels().gather;
  for (Dim n = 0; n < images; ++n) gather(job, x + n * in_pixels * job.cin, y + n * out_pixels * job.cout);
}

}  // namespace

Tensor transposed_weights(const real* weights, Dim taps, Dim cin, Dim cout) {
  Tensor transposed(Shape{taps, cout, cin});
  for (Dim t = 0, at = 0; t < taps; ++t, at += cin * cout)
    isa_kernels().transpose(cin, cout, weights + at, cout, transposed.data() + at, cin);
  return transposed;
}

void conv(const ConvSizes& s, const real* x, const real* w, const real* bias, real negative_slope, real* y) {
  if (is_narrow(s)) return narrow_conv(s, x, w, bias, negative_slope, y);
  if (is_winograd(s)) return winograd_conv(s, x, w, bias, negative_slope, y);
  GatherJob job{nullptr, w, bias, s.cin, s.cout, Into::overwrite, negative_slope};
  if (s.conv == kOnePixel) return isa_kernels().gather_rows(job, x, y, s.images);
  job.phases = &geometry_of(s.conv).forward;
  gather_batch(job, s.images, s.in_pixels(), s.out_pixels(), x, y);
}

void conv_grad_x(const ConvSizes& s, const real* gy, const real* w, Slot gx) {
  if (is_narrow(s)) return narrow_grad_x(s, gy, w, gx);
  if (is_winograd(s)) return winograd_grad_x(s, gy, w, gx);
  const Tensor wt = transposed_weights(w, s.conv.taps(), s.cin, s.cout);
  GatherJob job{nullptr, wt.data(), nullptr, s.cout, s.cin, gx.into, 1};
  if (s.conv == kOnePixel) return isa_kernels().gather_rows(job, gy, gx.data, s.images);
  job.phases = &geometry_of(s.conv).backward;
  gather_batch(job, s.images, s.out_pixels(), s.in_pixels(), gy, gx.data);
}

// A chunk of images passes all taps before the next one, while it is in the cache.
void conv_grad_w(const ConvSizes& s, const real* x, const real* gy, Slot gw) {
  if (s.images == 0) gw.begin(s.conv.taps() * s.cin * s.cout);
  if (is_narrow(s)) return narrow_grad_w(s, x, gy, gw);
  if (is_winograd(s)) return winograd_grad_w(s, x, gy, gw);
  static const std::vector<TapPairs> kOnePair{{{0}, {0}}};
  const auto outer = isa_kernels().outer;
  const std::vector<TapPairs>& taps = s.conv == kOnePixel ? kOnePair : geometry_of(s.conv).pairs;
  const Dim in_pixels = s.in_pixels(), out_pixels = s.out_pixels();
  const Dim chunk = std::max<Dim>(1, kRowsPerPiece / out_pixels);
  for (Dim n = 0; n < s.images; n += chunk) {
    OuterJob job{nullptr,
                 x + n * in_pixels * s.cin,
                 gy + n * out_pixels * s.cout,
                 gw.data,
                 std::min(chunk, s.images - n),
                 in_pixels,
                 out_pixels,
                 s.cin,
                 s.cout,
                 n == 0 ? gw.into : Into::add};
    for (const TapPairs& pairs : taps) {
      job.pairs = &pairs;
      outer(job);
      job.gw += s.cin * s.cout;
    }
  }
}

}  // namespace supertac::kernels::fast
