// Moves of numbers, callable without a graph.
#pragma once

#include <algorithm>

#include "autograd/tensor.h"

namespace supertac::kernels {

/// Columns at .. at + length of an array of rows of this width.
struct Columns {
  Dim width, at;
};
/// to[r, t.at + i] = or += from[r, f.at + i] for each row r and i < length
inline void move_columns(Dim rows, Dim length, const real* from, Columns f, Into into, real* to, Columns t) {
  for (Dim r = 0; r < rows; ++r) {
    const real* source = from + r * f.width + f.at;
    real* target = to + r * t.width + t.at;
    if (into == Into::overwrite && length == 4) {
      std::copy_n(source, 4, target);  // one move
    } else if (into == Into::overwrite) {
      std::copy_n(source, length, target);
    } else {
      for (Dim i = 0; i < length; ++i) target[i] += source[i];
    }
  }
}

/// to[n, j, i] = or += from[n, i, j]
inline void transpose(Dim images, Dim rows, Dim columns, const real* from, Into into, real* to) {
  for (Dim n = 0; n < images; ++n, from += rows * columns, to += rows * columns) {
    for (Dim i = 0; i < rows; ++i) {
      for (Dim j = 0; j < columns; ++j) {
        real& element = to[j * rows + i];
        element = from[i * columns + j] + (into == Into::add ? element : 0);
      }
    }
  }
}

}  // namespace supertac::kernels
