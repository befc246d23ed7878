#include "lessons.h"

namespace lessons {
namespace {

template <class F>
void for_each_product(const Line& s, F f) {
  for (std::size_t l = 0; l < s.out_length(); ++l)
    for (std::size_t k = 0; k < s.kernel; ++k) {
      const std::size_t at = l * s.stride + k;
      if (at < s.padding || at - s.padding >= s.length) continue;
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

void conv_gradient(const Line& s, const Array& x, const Array& w, const Array& gy, Array& gx, Array& gw,
                   Array& gbias) {
  for (std::size_t at = 0; at < gy.size(); ++at) gbias[at % s.out] += gy[at];
  for_each_product(s, [&](std::size_t ix, std::size_t iw, std::size_t iy) {
    gx[ix] += gy[iy] * w[iw];
    gw[iw] += gy[iy] * x[ix];
  });
}

void conv_transpose(const Line& s, const Array& z, const Array& w, const Array& bias, Array& t) {
  for (std::size_t at = 0; at < t.size(); ++at) t[at] = bias[at % s.out];
  for (std::size_t l = 0; l < s.length; ++l)
    for (std::size_t k = 0; k < s.kernel; ++k) {
      const std::size_t at = l * s.stride + k;
      if (at < s.padding || at - s.padding >= s.transposed_length()) continue;
      for (std::size_t i = 0; i < s.in; ++i)
        for (std::size_t o = 0; o < s.out; ++o)
          t[(at - s.padding) * s.out + o] += z[l * s.in + i] * w[(k * s.in + i) * s.out + o];
    }
}

}  // namespace lessons
