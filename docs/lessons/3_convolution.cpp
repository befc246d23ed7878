// Lesson 3: the convolution along time, and its transpose.
#include "lessons.h"

namespace lessons {
namespace {

// Calls f(index into x, index into w, index into y) for every product that the convolution sums up.
template <class F>
void for_each_product(const Line& s, F f) {
  for (std::size_t l = 0; l < s.out_length(); ++l)
    for (std::size_t k = 0; k < s.kernel; ++k) {
      const std::size_t at = l * s.stride + k;
      if (at < s.padding || at - s.padding >= s.length) continue;  // a zero beyond the ends
      for (std::size_t i = 0; i < s.in; ++i)
        for (std::size_t o = 0; o < s.out; ++o)
          f((at - s.padding) * s.in + i, (k * s.in + i) * s.out + o, l * s.out + o);
    }
}

}  // namespace

void conv(const Line& s, const Array& x, const Array& w, const Array& bias, Array& y) {
  for (std::size_t at = 0; at < y.size(); ++at) y[at] = bias[at % s.out];
  for_each_product(s, [&](std::size_t ix, std::size_t iw, std::size_t iy) { y[iy] += x[ix] * w[iw]; });
}

void conv_gradient(const Line& /*s*/, const Array& /*x*/, const Array& /*w*/, const Array& /*gy*/,
                   Array& /*gx*/, Array& /*gw*/, Array& /*gbias*/) {
  // The same products, seen from x, w and bias.
}

void conv_transpose(const Line& /*s*/, const Array& /*z*/, const Array& /*w*/, const Array& /*bias*/,
                    Array& /*t*/) {
  // t[l stride + k - padding, o] = bias[o] + sum of z[l,i] w[k,i,o]. What falls beyond the ends of t is
  // dropped.
}

}  // namespace lessons
