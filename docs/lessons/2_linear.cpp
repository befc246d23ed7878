// Lesson 2: the linear layer.
#include "lessons.h"

namespace lessons {

void linear(const Table& s, const Array& x, const Array& w, const Array& bias, Array& y) {
  for (std::size_t n = 0; n < s.rows; ++n)
    for (std::size_t o = 0; o < s.out; ++o) {
      y[n * s.out + o] = bias[o];
      for (std::size_t i = 0; i < s.in; ++i) y[n * s.out + o] += x[n * s.in + i] * w[i * s.out + o];
    }
}

void linear_gradient(const Table& /*s*/, const Array& /*x*/, const Array& /*w*/, const Array& /*gy*/,
                     Array& /*gx*/, Array& /*gw*/, Array& /*gbias*/) {
  // gy[n,o] = dL/dy[n,o] is given. Add dL/dx[n,i] to gx, dL/dw[i,o] to gw and dL/dbias[o] to gbias.
}

}  // namespace lessons
