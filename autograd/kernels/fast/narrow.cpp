#include "autograd/kernels/fast/narrow.h"

#include <algorithm>
#include <utility>

#include "autograd/kernels/fast/conv.h"

namespace supertac::kernels {
namespace {

// Taps times outputs, filled up with zeros to a whole vector: a partial one costs more than the zeros.
constexpr Dim kColumns = 16, kMostOutputs = 8;

// [taps][cin][cout] -> [cin][(taps, cout), zeros]
Tensor with_taps_inside(const ConvTask& s, const real* w) {
  Tensor out = Tensor::zeros({s.cin, kColumns});
  for (Dim t = 0; t < s.geometry->taps; ++t) {
    for (Dim i = 0; i < s.cin; ++i) {
      for (Dim o = 0; o < s.cout; ++o) out.data()[i * kColumns + t * s.cout + o] = *w++;
    }
  }
  return out;
}

// to[p, t, o] = gy[q, o] where tap t joins p and q, else 0, for one image
template <Dim kOutputs>
void spread(const ConvTask& s, const real* gy, real* to) {
  for (const Phase& phase : s.geometry->backward) {
    const std::int32_t* source = phase.sources.data();
    const std::int32_t* const taps = phase.taps.data();
    const std::size_t tap_count = phase.taps.size();
    for (const std::int32_t p : phase.outputs) {
      real* const row = to + p * kColumns;
      std::fill_n(row, kColumns, real(0));
      for (std::size_t t = 0; t < tap_count; ++t) {
        if (source[t] >= 0) std::copy_n(gy + source[t] * kOutputs, kOutputs, row + taps[t] * kOutputs);
      }
      source += tap_count;
    }
  }
}

// y[q, o] = bias[o] + sum over taps of z[source(t, q), t, o] for one image; the last row of z is zero.
template <Dim kOutputs>
void collect(const ConvTask& s, const real* z, const real* bias, real* y) {
  const std::int32_t padding = static_cast<std::int32_t>(s.geometry->in_pixels);
  for (const Phase& phase : s.geometry->forward) {
    const std::int32_t* source = phase.sources.data();
    const std::int32_t* const taps = phase.taps.data();
    const std::size_t tap_count = phase.taps.size();
    for (const std::int32_t q : phase.outputs) {
      real total[kOutputs] = {};
      for (Dim o = 0; bias != nullptr && o < kOutputs; ++o) total[o] = bias[o];
      for (std::size_t t = 0; t < tap_count; ++t) {
        const std::int32_t p = source[t] >= 0 ? source[t] : padding;
        const real* part = z + p * kColumns + taps[t] * kOutputs;
        for (Dim o = 0; o < kOutputs; ++o) total[o] += part[o];
      }
      std::copy_n(total, kOutputs, y + q * kOutputs);
      source += tap_count;
    }
  }
}

// use(the number of outputs as a constant): the inner loops must know it to be fast.
template <class Use>
void with_outputs(Dim outputs, Use use) {
  [&]<std::size_t... kBelow>(std::index_sequence<kBelow...>) {
    ((outputs == kBelow + 1 ? use(std::integral_constant<Dim, kBelow + 1>()) : void()), ...);
  }
  (std::make_index_sequence<kMostOutputs>());
}

// Of all images.
Tensor spread(const ConvTask& s, const real* gy) {
  const Geometry& g = *s.geometry;
  Tensor gz(Shape{s.images, g.in_pixels, kColumns});
  with_outputs(s.cout, [&](auto outputs) {
    for (Dim n = 0; n < s.images; ++n)
      spread<outputs>(s, gy + n * g.out_pixels * outputs, gz.data() + n * g.in_pixels * kColumns);
  });
  return gz;
}

}  // namespace

bool is_narrow(const ConvTask& s) {
  return s.geometry->taps * s.cout <= kColumns && s.cout <= kMostOutputs && s.cout * 2 < s.cin;
}

void narrow_conv(const ConvTask& s, const real* x, const real* w, const real* bias, real negative_slope,
                 real* y) {
  const Geometry& g = *s.geometry;
  const Tensor inside = with_taps_inside(s, w);
  Tensor z(Shape{g.in_pixels + 1, kColumns});
  std::fill_n(z.data() + g.in_pixels * kColumns, kColumns, real(0));
  for (Dim n = 0; n < s.images; ++n) {
    fast::linear(g.in_pixels, s.cin, kColumns, x + n * g.in_pixels * s.cin, inside.data(), nullptr, 1,
                 z.data());
    with_outputs(s.cout,
                 [&](auto outputs) { collect<outputs>(s, z.data(), bias, y + n * g.out_pixels * outputs); });
  }
  if (negative_slope == 1) return;
  for (Dim i = 0; i < s.images * g.out_pixels * s.cout; ++i) y[i] = y[i] > 0 ? y[i] : negative_slope * y[i];
}

void narrow_grad_x(const ConvTask& s, const real* gy, const real* w, Into into, real* gx) {
  fast::linear_grad_x(s.images * s.geometry->in_pixels, s.cin, kColumns, spread(s, gy).data(),
                      with_taps_inside(s, w).data(), into, gx);
}

void narrow_grad_w(const ConvTask& s, const real* x, const real* gy, Into into, real* gw) {
  if (into == Into::overwrite) std::fill_n(gw, s.geometry->taps * s.cin * s.cout, real(0));
  Tensor inside(Shape{s.cin, kColumns});
  fast::linear_grad_w(s.images * s.geometry->in_pixels, s.cin, kColumns, x, spread(s, gy).data(),
                      Into::overwrite, inside.data());
  for (Dim t = 0; t < s.geometry->taps; ++t) {
    for (Dim i = 0; i < s.cin; ++i) {
      for (Dim o = 0; o < s.cout; ++o) *gw++ += inside.data()[i * kColumns + t * s.cout + o];
    }
  }
}

}  // namespace supertac::kernels
