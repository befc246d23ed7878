// Convolutions with few outputs (the picture's single channel, a decoder's four taxels).
//
// The gather kernel puts output channels side by side in a vector; with one channel it would leave 15 of 16
// lanes empty. Here taps and output channels together fill the vector:
//   z[p, t, o] = sum over cin of x[p, :] * w[t, :, o]        one matrix product
//   y[q, o]    = bias[o] + sum over taps t of z[q + t, t, o]
// The gradients are one product each with gz[p, t, o] = gy[p - t, o].
#include "autograd/kernels/fast/conv.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "autograd/kernels/fast/isa/isa.h"

namespace supertac::kernels {
namespace {

// Taps times outputs, in a product that makes them filled up with zeros to a whole vector: a partial one
// costs more than the zeros.
constexpr Dim kColumns = 16;
constexpr Dim kAcross = 3, kMostOutputs = kColumns / kAcross;  // taps of a line

constexpr Dim kPart = 4;
constexpr Dim filled_up(Dim n) { return (n + kPart - 1) / kPart * kPart; }

Dim sums_of(const ConvSizes& s) { return s.conv.taps() * s.cout; }
// The lines of a map with its margin, and the pixels of one.
Dim lines_of(const ConvSizes& s) { return s.conv.height + s.conv.kernel_h - 1; }
Dim line_of(const ConvSizes& s) { return s.conv.width + kAcross - 1; }

// [taps][cin][cout] -> [cin][(taps, cout), zeros]
Tensor with_taps_inside(const ConvSizes& s, const real* w) {
  Tensor out = Tensor::zeros({s.cin, kColumns});
  for (Dim t = 0; t < s.conv.taps(); ++t) {
    for (Dim i = 0; i < s.cin; ++i) {
      for (Dim o = 0; o < s.cout; ++o) out.data()[i * kColumns + t * s.cout + o] = *w++;
    }
  }
  return out;
}

// to[p, t, o] = gy[p - t, o], 0 outside the map, for one image. Of `turned`, the map by half a turn with a
// margin of zeros, the taps of a line lie side by side.
template <Dim kOutputs>
void expanded(const ConvSizes& s, const real* gy, real* turned, real* to) {
  constexpr Dim kRun = kAcross * kOutputs;
  const Dim width = s.conv.width, height = s.conv.height, taps_down = s.conv.kernel_h;
  const Dim line = line_of(s) * kOutputs;
  real* inside = turned + (height - 1 + taps_down / 2) * line + width * kOutputs;
  for (Dim i = 0; i < height; ++i, inside -= line) {
    for (Dim j = 0; j < width; ++j, gy += kOutputs)
      std::memcpy(inside - j * kOutputs, gy, kOutputs * sizeof(real));
  }
  const real* last = turned + (height - 1) * line + (width - 1) * kOutputs;
  for (Dim i = 0; i < height; ++i, last -= line) {
    for (Dim j = 0; j < width; ++j) {
      const real* from = last - j * kOutputs;
      for (Dim k = 0; k < taps_down; ++k, from += line, to += kRun)  // what is too much is written over
        std::memcpy(to, from, filled_up(kRun) * sizeof(real));
    }
  }
}

// y[q, o] = bias[o] + sum over taps of z[q + t, t, o] for one image; z has a margin of zeros.
template <Dim kOutputs>
void collect(const ConvSizes& s, const real* z, const real* bias, real* y) {
  const ConvSettings& c = s.conv;
  for (Dim i = 0; i < c.height; ++i, y += c.width * kOutputs) {
    for (Dim j = 0; j < c.width * kOutputs; ++j) y[j] = bias != nullptr ? bias[j % kOutputs] : 0;
    for (Dim k = 0; k < c.kernel_h; ++k) {
      const real* part = z + (i + k) * line_of(s) * kColumns + k * kAcross * kOutputs;
      for (Dim j = 0; j < c.width; ++j, part += kColumns) {
        real total[kOutputs];
        for (Dim o = 0; o < kOutputs; ++o) total[o] = y[j * kOutputs + o];
        for (Dim t = 0; t < kAcross; ++t) {
          for (Dim o = 0; o < kOutputs; ++o) total[o] += part[t * (kColumns + kOutputs) + o];
        }
        std::copy_n(total, kOutputs, y + j * kOutputs);
      }
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
Tensor expanded(const ConvSizes& s, const real* gy) {
  Tensor turned = Tensor::zeros({lines_of(s) * line_of(s) * s.cout + kPart});
  Tensor gz(Shape{s.images * s.in_pixels() * sums_of(s) + kPart});
  with_outputs(s.cout, [&](auto outputs) {
    for (Dim n = 0; n < s.images; ++n) {
      expanded<outputs>(s, gy + n * s.in_pixels() * outputs, turned.data(),
                        gz.data() + n * s.in_pixels() * sums_of(s));
    }
  });
  return gz;
}

}  // namespace

bool is_narrow(const ConvSizes& s) {
  const ConvSettings& c = s.conv;
  ConvSettings same{.height = c.height, .width = c.width, .kernel_h = c.kernel_h, .kernel_w = kAcross};
  same.padding_h = c.kernel_h / 2, same.padding_w = kAcross / 2;
  return c == same && c.kernel_h % 2 == 1 && sums_of(s) <= kColumns && s.cout * 2 < s.cin;
}

void narrow_conv(const ConvSizes& s, const real* x, const real* w, const real* bias, real negative_slope,
                 real* y) {
  const ConvSettings& c = s.conv;
  const Tensor inside = with_taps_inside(s, w);
  const Dim line = line_of(s) * kColumns, pixel_itself = 0;
  Tensor z = Tensor::zeros({lines_of(s), line});
  const ProductJob job{.height = c.height,
                       .width = c.width,
                       .from = {0, c.width * s.cin, s.cin},
                       .to = {0, line, kColumns},
                       .segments = &pixel_itself,
                       .segment_count = 1,
                       .length = s.cin,
                       .w = inside.data(),
                       .cout = kColumns};
  for (Dim n = 0; n < s.images; ++n) {
    isa_kernels().product(job, x + n * s.in_pixels() * s.cin,
                          z.data() + c.padding_h * line + c.padding_w * kColumns);
    with_outputs(s.cout,
                 [&](auto outputs) { collect<outputs>(s, z.data(), bias, y + n * s.in_pixels() * outputs); });
  }
  if (negative_slope != 1)
    std::transform(y, y + s.images * s.in_pixels() * s.cout, y, Rectifier(negative_slope));
}

void narrow_grad_x(const ConvSizes& s, const real* gy, const real* w, Slot gx) {
  const Tensor wt = fast::transposed_weights(w, s.conv.taps(), s.cin, s.cout);
  isa_kernels().gather_rows({nullptr, wt.data(), nullptr, sums_of(s), s.cin, gx.into, 1},
                            expanded(s, gy).data(), gx.data, s.images * s.in_pixels());
}

void narrow_grad_w(const ConvSizes& s, const real* x, const real* gy, Slot gw) {
  Tensor inside(Shape{sums_of(s), s.cin});
  linear_grad_w(s.images * s.in_pixels(), sums_of(s), s.cin, expanded(s, gy).data(), x,
                {inside.data(), Into::overwrite});
  for (Dim t = 0; t < s.conv.taps(); ++t) {
    for (Dim i = 0; i < s.cin; ++i) {
      for (Dim o = 0; o < s.cout; ++o, ++gw.data) {
        const real sum = inside.data()[(t * s.cout + o) * s.cin + i];
        *gw.data = gw.into == Into::add ? *gw.data + sum : sum + 0;
      }
    }
  }
}

}  // namespace supertac::kernels
