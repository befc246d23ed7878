// Sums whose bits do not depend on the width of vectors: 16 lanes that are added in a fixed order.
#pragma once

#include "autograd/kernels/fast/loops.h"
#include "autograd/tensor.h"

namespace supertac::kernels {

/// The sum of term(i) over [0, n) in double precision.
template <class F>
double sum_lanes(Dim n, F&& term) {
  constexpr Dim kLanes = 16;
  double total = 0;
  run_loop([&, n]() SUPERTAC_LOOP {
    double lane[kLanes] = {};
    Dim i = 0;
    for (; i + kLanes <= n; i += kLanes) {
      for (Dim j = 0; j < kLanes; ++j) lane[j] += term(i + j);
    }
    for (Dim j = 0; i < n; ++i, ++j) lane[j] += term(i);
    for (Dim j = 0; j < kLanes; ++j) total += lane[j];
  });
  return total;
}

}  // namespace supertac::kernels
