// Work cut into fixed pieces: which thread runs a piece never changes a bit of the result.
#pragma once

#include <algorithm>

#include "autograd/pool.h"
#include "autograd/tensor.h"

namespace supertac::kernels {

inline constexpr Dim kPieceElements = Dim{1} << 14;

/// Calls f(begin, end) for consecutive ranges that cover [0, n).
template <class F>
void for_pieces(Dim n, F&& f, Dim piece = kPieceElements) {
  const Dim pieces = (n + piece - 1) / piece;
  if (pieces <= 1) {
    if (n > 0) f(Dim{0}, n);
    return;
  }
#pragma omp parallel for schedule(static)
  for (Dim i = 0; i < pieces; ++i) f(i * piece, std::min(n, (i + 1) * piece));
}

/// The sum of f(begin, end) over the same ranges, added in their order.
template <class F>
double sum_pieces(Dim n, F&& f, Dim piece = kPieceElements) {
  const Dim pieces = (n + piece - 1) / piece;
  Scratch<double> part(static_cast<std::size_t>(std::max<Dim>(pieces, 1)));
  for_pieces(
      n, [&](Dim begin, Dim end) { part[static_cast<std::size_t>(begin / piece)] = f(begin, end); }, piece);
  double total = 0;
  for (Dim i = 0; i < pieces; ++i) total += part[static_cast<std::size_t>(i)];
  return total;
}

/// The sum of term(i) over [begin, end) in double precision, in 16 lanes that are added in a fixed order.
template <class F>
double sum_lanes(Dim begin, Dim end, F&& term) {
  constexpr Dim kLanes = 16;
  double lane[kLanes] = {};
  Dim i = begin;
  for (; i + kLanes <= end; i += kLanes) {
    for (Dim j = 0; j < kLanes; ++j) lane[j] += term(i + j);
  }
  for (Dim j = 0; i < end; ++i, ++j) lane[j] += term(i);
  double total = 0;
  for (Dim j = 0; j < kLanes; ++j) total += lane[j];
  return total;
}

}  // namespace supertac::kernels
