#include "models/inference/prepared/taps.h"

#include <algorithm>

namespace supertac {

static Dim reach(Dim size, Dim out, Dim kernel, Dim stride, Dim padding, bool transposed) {
  const Dim before = transposed ? (kernel - 1 - padding + stride - 1) / stride : padding;
  const Dim last = transposed ? (out - 1 + padding) / stride : (out - 1) * stride + kernel - 1 - padding;
  return std::max<Dim>({0, before, last - (size - 1)});
}

void Margin::widen(const kernels::ConvSettings& s) {
  height =
      std::max(height, reach(s.height, s.out_height(), s.kernel_h, s.stride_h, s.padding_h, s.transposed));
  width = std::max(width, reach(s.width, s.out_width(), s.kernel_w, s.stride_w, s.padding_w, s.transposed));
}

Tensor phase_weights(const kernels::ConvSettings& s, const Phase& v, const Phase& h, const Variable& w) {
  const Dim size = w.dim(w.rank() - 2) * w.dim(w.rank() - 1);
  Tensor out(Shape{v.taps * h.taps, size});
  real* to = out.data();
  for (Dim jy = v.taps - 1; jy >= 0; --jy) {
    for (Dim jx = h.taps - 1; jx >= 0; --jx, to += size) {
      const Dim tap = (v.tap + s.stride_h * jy) * s.kernel_w + h.tap + s.stride_w * jx;
      std::copy_n(w.value().data() + tap * size, size, to);
    }
  }
  return out;
}

Tensor with_pixels_outside(const Tensor& t, Dim outer, Dim pixels, Dim inner) {
  if (pixels == 1) return t.clone();
  Tensor out(t.shape());
  const Dim channels = t.size() / (outer * pixels * inner);
  real* to = out.data();
  for (Dim a = 0; a < outer; ++a) {
    for (Dim p = 0; p < pixels; ++p) {
      for (Dim c = 0; c < channels; ++c, to += inner)
        std::copy_n(t.data() + ((a * channels + c) * pixels + p) * inner, inner, to);
    }
  }
  return out;
}

}  // namespace supertac
