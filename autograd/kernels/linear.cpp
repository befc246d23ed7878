#include "autograd/kernels/linear.h"

#include <algorithm>
#include <cmath>

#include "autograd/kernels/fast/conv.h"
#include "autograd/kernels/fast/isa/isa.h"
#include "autograd/kernels/fast/loops.h"

namespace supertac::kernels {

void linear(Dim rows, Dim cin, Dim cout, const real* x, const real* w, const real* bias, real negative_slope,
            real* y) {
  if (!is_plain()) return fast::linear(rows, cin, cout, x, w, bias, negative_slope, y);
  for (Dim n = 0; n < rows; ++n) {
    for (Dim o = 0; o < cout; ++o) {
      real sum = bias != nullptr ? bias[o] : 0;
      for (Dim i = 0; i < cin; ++i) sum = std::fma(x[n * cin + i], w[i * cout + o], sum);  // rounds once
      y[n * cout + o] = sum > 0 ? sum : negative_slope * sum;
    }
  }
}

void linear_grad_x(Dim rows, Dim cin, Dim cout, const real* gy, const real* w, Into into, real* gx) {
  if (!is_plain()) return fast::linear_grad_x(rows, cin, cout, gy, w, into, gx);
  for (Dim n = 0; n < rows; ++n) {
    for (Dim i = 0; i < cin; ++i) {
      real sum = into == Into::add ? gx[n * cin + i] : 0;
      for (Dim o = 0; o < cout; ++o) sum = std::fma(gy[n * cout + o], w[i * cout + o], sum);
      gx[n * cin + i] = sum;
    }
  }
}

void linear_grad_w(Dim rows, Dim cin, Dim cout, const real* x, const real* gy, Into into, real* gw) {
  if (!is_plain()) return fast::linear_grad_w(rows, cin, cout, x, gy, into, gw);
  if (into == Into::overwrite) std::fill_n(gw, cin * cout, real(0));
  for (Dim i = 0; i < cin; ++i) {
    for (Dim o = 0; o < cout; ++o) {
      for (Dim n = 0; n < rows; ++n) {
        gw[i * cout + o] = std::fma(x[n * cin + i], gy[n * cout + o], gw[i * cout + o]);
      }
    }
  }
}

void bias_grad(Dim rows, Dim cout, const real* gy, Into into, real* gb) {
  constexpr Dim kAtOnce = 16;  // sums that stay in registers
  if (into == Into::overwrite) std::fill_n(gb, cout, real(0));
  for (Dim first = 0; first < rows; first += kRowsPerPiece) {
    const Dim last = std::min(rows, first + kRowsPerPiece);
    run_loop([=]() SUPERTAC_LOOP {
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
        for (Dim k = 0; k < count; ++k) gb[c + k] += sum[k];
      }
    });
  }
}

}  // namespace supertac::kernels
