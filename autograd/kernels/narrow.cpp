#include "autograd/kernels/narrow.h"

#include <algorithm>

namespace supertac::kernels {
namespace {

constexpr Dim kMostColumns = 16;

Dim columns_of(const ConvSizes& s) { return s.geometry->taps * s.cout; }

// [taps][cin][cout] -> [cin][taps][cout]
Tensor with_taps_inside(const ConvSizes& s, const real* w) {
  Tensor out(Shape{s.cin, s.geometry->taps, s.cout});
  for (Dim t = 0; t < s.geometry->taps; ++t) {
    for (Dim i = 0; i < s.cin; ++i) {
      std::copy_n(w + (t * s.cin + i) * s.cout, s.cout, out.data() + (i * s.geometry->taps + t) * s.cout);
    }
  }
  return out;
}

// Calls f(image, tap's offset in a row of z, input pixel, output pixel) for all pairs.
template <class F>
void for_each_pair(const ConvSizes& s, F f) {
  const Geometry& g = *s.geometry;
  for (Dim n = 0; n < s.images; ++n) {
    for (Dim t = 0; t < g.taps; ++t) {
      const TapPairs& pairs = g.pairs[static_cast<std::size_t>(t)];
      for (std::size_t i = 0; i < pairs.inputs.size(); ++i)
        f(n, t * s.cout, pairs.inputs[i], pairs.outputs[i]);
    }
  }
}

// gz[p, t, o] = gy[q, o] where tap t joins p and q, else 0
Tensor spread(const ConvSizes& s, const real* gy) {
  const Geometry& g = *s.geometry;
  Tensor gz = Tensor::zeros({s.images, g.in_pixels, columns_of(s)});
  real* to = gz.data();
  for_each_pair(s, [&, to](Dim n, Dim tap, Dim p, Dim q) {
    real* z = to + (n * g.in_pixels + p) * columns_of(s) + tap;
    const real* from = gy + (n * g.out_pixels + q) * s.cout;
    for (Dim o = 0; o < s.cout; ++o) z[o] = from[o];
  });
  return gz;
}

}  // namespace

bool is_narrow(const ConvSizes& s) { return columns_of(s) <= kMostColumns && s.cout * 2 < s.cin; }

void narrow_conv(const ConvSizes& s, const real* x, const real* w, const real* bias, real* y) {
  const Geometry& g = *s.geometry;
  const Tensor inside = with_taps_inside(s, w);
  Tensor z(Shape{s.images, g.in_pixels, columns_of(s)});
  linear(s.images * g.in_pixels, s.cin, columns_of(s), x, inside.data(), nullptr, z.data());
  for (Dim i = 0; i < s.images * g.out_pixels; ++i) {
    for (Dim o = 0; o < s.cout; ++o) y[i * s.cout + o] = bias != nullptr ? bias[o] : 0;
  }
  const real* from = z.data();
  for_each_pair(s, [&, from](Dim n, Dim tap, Dim p, Dim q) {
    const real* part = from + (n * g.in_pixels + p) * columns_of(s) + tap;
    real* to = y + (n * g.out_pixels + q) * s.cout;
    for (Dim o = 0; o < s.cout; ++o) to[o] += part[o];
  });
}

void narrow_grad_x(const ConvSizes& s, const real* gy, const real* w, real* gx) {
  linear_grad_x(s.images * s.geometry->in_pixels, s.cin, columns_of(s), spread(s, gy).data(),
                with_taps_inside(s, w).data(), gx);
}

void narrow_grad_w(const ConvSizes& s, const real* x, const real* gy, real* gw) {
  Tensor inside = Tensor::zeros({s.cin, s.geometry->taps, s.cout});
  linear_grad_w(s.images * s.geometry->in_pixels, s.cin, columns_of(s), x, spread(s, gy).data(),
                inside.data());
  for (Dim i = 0; i < s.cin; ++i) {
    for (Dim t = 0; t < s.geometry->taps; ++t) {
      for (Dim o = 0; o < s.cout; ++o) {
        gw[(t * s.cin + i) * s.cout + o] += inside.data()[(i * s.geometry->taps + t) * s.cout + o];
      }
    }
  }
}

}  // namespace supertac::kernels
