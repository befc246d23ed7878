// Loops that move numbers without changing them, callable without a graph. They check nothing.
#pragma once

#include <algorithm>
#include <cmath>

#include "autograd/tensor.h"

namespace supertac::kernels {

/// Columns at .. at + length of an array of rows of this width.
struct Columns {
  Dim width, at;
};
/// to[r, t.at + i] = or += from[r, f.at + i] for each row r and i < length
inline void move_columns(Dim rows, Dim length, const real* from, Columns f, Slot to, Columns t) {
  if (!to) return;
  for (Dim r = 0; r < rows; ++r) {
    const real* source = from + r * f.width + f.at;
    real* target = to.data + r * t.width + t.at;
    if (to.into == Into::overwrite && length == 4) {
      std::copy_n(source, 4, target);  // one move
    } else if (to.into == Into::overwrite) {
      std::copy_n(source, length, target);
    } else {
      for (Dim i = 0; i < length; ++i) target[i] += source[i];
    }
  }
}

/// to[n, j, i] = or += from[n, i, j]
inline void transpose(Dim images, Dim rows, Dim columns, const real* from, Slot to) {
  if (!to) return;
  for (Dim n = 0; n < images; ++n, from += rows * columns, to.data += rows * columns)
    for (Dim i = 0; i < rows; ++i)
      for (Dim j = 0; j < columns; ++j) {
        real& element = to.data[j * rows + i];
        element = from[i * columns + j] + (to.into == Into::add ? element : 0);
      }
}

/// Calls visit(from, to) for each element of y with the place of the largest of its four elements of x: of
/// the first among equal ones, of a NaN if there is one. Shapes as max_pool2d().
template <class Visit>
void for_each_maximum(const Shape& shape, const real* x, Visit visit) {
  const Dim height = shape[1], width = shape[2], channels = shape[3];
  Dim to = 0;
  for (Dim n = 0; n < shape[0]; ++n)
    for (Dim i = 0; i < height / 2; ++i)
      for (Dim j = 0; j < width / 2; ++j)
        for (Dim c = 0; c < channels; ++c) {
          const Dim corner = ((n * height + 2 * i) * width + 2 * j) * channels + c,
                    below = corner + width * channels;
          Dim best = corner;
          for (const Dim at : {corner + channels, below, below + channels})
            if (x[at] > x[best] || std::isnan(x[at])) best = at;
          visit(best, to++);
        }
}

/// x of shape [N,H,W,C], y [N,H/2,W/2,C] = the maxima of its 2x2 blocks
inline void max_pool2d(const Shape& shape, const real* x, real* y) {
  for_each_maximum(shape, x, [=](Dim from, Dim to) { y[to] = x[from]; });
}
/// gx[where the largest was] = or += gy, elsewhere 0 or as it was
inline void max_pool2d_grad(const Shape& shape, const real* x, const real* gy, Slot gx) {
  if (!gx) return;
  gx.begin(shape.elements());
  for_each_maximum(shape, x, [=](Dim from, Dim to) { gx.data[from] += gy[to]; });
}

}  // namespace supertac::kernels
