#include "lessons.h"

namespace lessons {

void linear(const Table& s, const Array& x, const Array& w, const Array& bias, Array& y) {
  for (std::size_t n = 0; n < s.rows; ++n)
    for (std::size_t o = 0; o < s.out; ++o) {
      y[n * s.out + o] = bias[o];
      for (std::size_t i = 0; i < s.in; ++i) y[n * s.out + o] += x[n * s.in + i] * w[i * s.out + o];
    }
}

void linear_gradient(const Table& s, const Array& x, const Array& w, const Array& gy, Array& gx, Array& gw,
                     Array& gbias) {
  for (std::size_t n = 0; n < s.rows; ++n)
    for (std::size_t o = 0; o < s.out; ++o) {
      const double g = gy[n * s.out + o];
      gbias[o] += g;
      for (std::size_t i = 0; i < s.in; ++i) {
        gx[n * s.in + i] += g * w[i * s.out + o];
        gw[i * s.out + o] += g * x[n * s.in + i];
      }
    }
}

}  // namespace lessons
