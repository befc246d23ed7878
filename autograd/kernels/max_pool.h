// The largest of every 2x2 pixels, callable without a graph. x [N,H,W,C], y [N,H/2,W/2,C].
#pragma once

#include <cmath>

#include "autograd/tensor.h"

namespace supertac::kernels {

/// Calls visit(from, to) for each element of y with the place of the largest of its four elements of x: of
/// the first among equal ones, of a NaN if there is one.
template <class Visit>
void for_each_maximum(const Shape& x_shape, const real* x, Visit visit) {
  const Dim height = x_shape[1], width = x_shape[2], channels = x_shape[3];
  Dim to = 0;
  for (Dim n = 0; n < x_shape[0]; ++n) {
    for (Dim i = 0; i < height / 2; ++i) {
      for (Dim j = 0; j < width / 2; ++j) {
        for (Dim c = 0; c < channels; ++c) {
          const Dim corner = ((n * height + 2 * i) * width + 2 * j) * channels + c,
                    below = corner + width * channels;
          Dim best = corner;
          for (const Dim at : {corner + channels, below, below + channels}) {
            if (x[at] > x[best] || std::isnan(x[at])) best = at;
          }
          visit(best, to++);
        }
      }
    }
  }
}

inline void max_pool(const Shape& x_shape, const real* x, real* y) {
  for_each_maximum(x_shape, x, [=](Dim from, Dim to) { y[to] = x[from]; });
}

/// gx[the largest] += gy
inline void max_pool_grad(const Shape& x_shape, const real* x, const real* gy, real* gx) {
  for_each_maximum(x_shape, x, [=](Dim from, Dim to) { gx[from] += gy[to]; });
}

}  // namespace supertac::kernels
