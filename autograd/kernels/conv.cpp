#include "autograd/kernels/conv.h"

#include <algorithm>
#include <cmath>

#include "autograd/kernels/fast/conv.h"
#include "autograd/kernels/fast/each.h"
#include "autograd/kernels/fast/isa/isa.h"

namespace supertac::kernels {

Dim ConvSettings::out_height() const {
  return transposed ? (height - 1) * stride_h - 2 * padding_h + kernel_h
                    : (height + 2 * padding_h - kernel_h) / stride_h + 1;
}
Dim ConvSettings::out_width() const {
  return transposed ? (width - 1) * stride_w - 2 * padding_w + kernel_w
                    : (width + 2 * padding_w - kernel_w) / stride_w + 1;
}

namespace {

// Calls add(a, b, c) for each x[a], w[b] and y[c] that a meeting joins: x [p, i], w [tap, i, o], y [q, o].
template <class Add>
void for_each_product(const ConvSizes& s, Add add) {
  for_each_meeting(s, [&](Dim tap, Dim p, Dim q) {
    for (Dim i = 0; i < s.cin; ++i)
      for (Dim o = 0; o < s.cout; ++o) add(p * s.cin + i, (tap * s.cin + i) * s.cout + o, q * s.cout + o);
  });
}

}  // namespace

// x [p, i], w [tap, i, o], bias [o], y [q, o]:   y[q, o] = f(bias[o] + sum of x[p, i] w[tap, i, o])
void conv(const ConvSizes& s, const real* x, const real* w, const real* bias, real negative_slope, real* y) {
  if (!is_plain()) return fast::conv(s, x, w, bias, negative_slope, y);
  const Dim pixels = s.images * s.out_pixels();
  for (Dim q = 0; q < pixels; ++q) {
    for (Dim o = 0; o < s.cout; ++o) y[q * s.cout + o] = bias != nullptr ? bias[o] : 0;
  }
  // Rounds once, as in fast/.
  for_each_product(s, [&](Dim a, Dim b, Dim c) { y[c] = std::fma(x[a], w[b], y[c]); });
  std::transform(y, y + pixels * s.cout, y, Rectifier(negative_slope));
}

// gx [p, i] = or += sum of gy[q, o] w[tap, i, o]
void conv_grad_x(const ConvSizes& s, const real* gy, const real* w, Slot gx) {
  if (!gx) return;
  if (!is_plain()) return fast::conv_grad_x(s, gy, w, gx);
  gx.begin(s.images * s.in_pixels() * s.cin);
  for_each_product(s, [&](Dim a, Dim b, Dim c) { gx.data[a] = std::fma(gy[c], w[b], gx.data[a]); });
}

// gw [tap, i, o] = or += sum of x[p, i] gy[q, o]
void conv_grad_w(const ConvSizes& s, const real* x, const real* gy, Slot gw) {
  if (!gw) return;
  if (!is_plain()) return fast::conv_grad_w(s, x, gy, gw);
  gw.begin(s.conv.taps() * s.cin * s.cout);
  for_each_product(s, [&](Dim a, Dim b, Dim c) { gw.data[b] = std::fma(x[a], gy[c], gw.data[b]); });
}

// gb[o] = or += sum over rows of gy[row,o]
void bias_grad(Dim rows, Dim cout, const real* gy, Slot gb) {
  constexpr Dim kAtOnce = 16;  // sums that stay in registers
  if (!gb) return;
  gb.begin(cout);
  for (Dim first = 0; first < rows; first += kRowsPerPiece) {
    const Dim last = std::min(rows, first + kRowsPerPiece);
    run_loop([=] {
      for (Dim c = 0; c < cout; c += kAtOnce) {
        const Dim count = std::min(kAtOnce, cout - c);
        real sum[kAtOnce] = {};
        if (count == kAtOnce) {
          for (Dim row = first; row < last; ++row)
            for (Dim k = 0; k < kAtOnce; ++k) sum[k] += gy[row * cout + c + k];
        } else {
          for (Dim row = first; row < last; ++row)
            for (Dim k = 0; k < count; ++k) sum[k] += gy[row * cout + c + k];
        }
        for (Dim k = 0; k < count; ++k) gb.data[c + k] += sum[k];
      }
    });
  }
}

}  // namespace supertac::kernels
