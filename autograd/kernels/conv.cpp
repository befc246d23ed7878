#include "autograd/kernels/conv.h"

#include <algorithm>

#include "autograd/kernels/isa.h"
#include "autograd/kernels/narrow.h"

namespace supertac::kernels {
namespace {

constexpr Dim kRowsPerPiece = 256;  // a sum over pixels runs over this many before it is added to the total

// [taps][cin][cout] -> [taps][cout][cin]
Tensor transposed_weights(const real* w, Dim taps, Dim cin, Dim cout) {
  Tensor out(Shape{taps, cout, cin});
  real* to = out.data();
  for (Dim t = 0; t < taps; ++t, w += cin * cout, to += cin * cout) {
    for (Dim i = 0; i < cin; ++i) {
      for (Dim o = 0; o < cout; ++o) to[o * cin + i] = w[i * cout + o];
    }
  }
  return out;
}

void gather_batch(const GatherJob& job, Dim images, Dim in_pixels, Dim out_pixels, const real* x, real* y) {
  const auto gather = isa_kernels().gather;
  for (Dim n = 0; n < images; ++n) gather(job, x + n * in_pixels * job.cin, y + n * out_pixels * job.cout);
}

}  // namespace

void conv(const ConvSizes& s, const real* x, const real* w, const real* bias, real* y) {
  if (is_narrow(s)) return narrow_conv(s, x, w, bias, y);
  const GatherJob job{&s.geometry->forward, w, bias, s.cin, s.cout, false};
  gather_batch(job, s.images, s.geometry->in_pixels, s.geometry->out_pixels, x, y);
}

void conv_grad_x(const ConvSizes& s, const real* gy, const real* w, real* gx) {
  if (is_narrow(s)) return narrow_grad_x(s, gy, w, gx);
  const Tensor wt = transposed_weights(w, s.geometry->taps, s.cin, s.cout);
  const GatherJob job{&s.geometry->backward, wt.data(), nullptr, s.cout, s.cin, true};
  gather_batch(job, s.images, s.geometry->out_pixels, s.geometry->in_pixels, gy, gx);
}

void conv_grad_w(const ConvSizes& s, const real* x, const real* gy, real* gw) {
  if (is_narrow(s)) return narrow_grad_w(s, x, gy, gw);
  const auto outer = isa_kernels().outer;
  const Geometry& g = *s.geometry;
  const Dim chunk = std::max<Dim>(1, kRowsPerPiece / g.out_pixels);
  for (Dim tap = 0; tap < g.taps; ++tap) {
    const OuterJob job{&g.pairs[static_cast<std::size_t>(tap)],
                       x,
                       gy,
                       gw + tap * s.cin * s.cout,
                       s.images,
                       g.in_pixels,
                       g.out_pixels,
                       s.cin,
                       s.cout,
                       chunk};
    for (Dim row = 0; row < s.cin; row += kOuterRows) outer(job, row);
  }
}

void linear(Dim rows, Dim cin, Dim cout, const real* x, const real* w, const real* bias, real* y) {
  isa_kernels().gather_rows({nullptr, w, bias, cin, cout, false}, x, y, rows);
}

void linear_grad_x(Dim rows, Dim cin, Dim cout, const real* gy, const real* w, real* gx) {
  const Tensor wt = transposed_weights(w, 1, cin, cout);
  isa_kernels().gather_rows({nullptr, wt.data(), nullptr, cout, cin, true}, gy, gx, rows);
}

void linear_grad_w(Dim rows, Dim cin, Dim cout, const real* x, const real* gy, real* gw) {
  static const TapPairs kOnePixel{{0}, {0}};
  const auto outer = isa_kernels().outer;
  const OuterJob job{&kOnePixel, x, gy, gw, rows, 1, 1, cin, cout, kRowsPerPiece};
  for (Dim row = 0; row < cin; row += kOuterRows) outer(job, row);
}

void bias_grad(Dim rows, Dim cout, const real* gy, real* gb) {
  Tensor piece(Shape{cout});
  for (Dim first = 0; first < rows; first += kRowsPerPiece) {
    piece.fill(0);
    const Dim last = std::min(rows, first + kRowsPerPiece);
    for (Dim row = first; row < last; ++row) {
      for (Dim c = 0; c < cout; ++c) piece.data()[c] += gy[row * cout + c];
    }
    for (Dim c = 0; c < cout; ++c) gb[c] += piece.data()[c];
  }
}

}  // namespace supertac::kernels
