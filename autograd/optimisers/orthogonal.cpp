#include "autograd/optimisers/orthogonal.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "autograd/kernels/fast/each.h"
#include "autograd/kernels/fast/pool.h"
#include "autograd/kernels/sums.h"
#include "autograd/ops/linear.h"

namespace supertac {
namespace {

constexpr int kSteps = 5;
constexpr real kA = real(3.4445), kB = real(-4.7750), kC = real(2.0315);

void multiply(Dim n, const real* a, const real* b, real* y) { kernels::linear(n, n, n, a, b, nullptr, 1, y); }

}  // namespace

// With S = X X^T a step is X <- P X, P = a I + b S + c S^2, and S <- P S P, so that Q, the product of all P,
// is found without X.
void orthogonalise(Dim rows, Dim columns, real* x) {
  const Dim size = rows * columns, side = std::min(rows, columns), square = side * side;
  const bool wide = rows <= columns;
  Scratch<real> start(static_cast<std::size_t>(size)), squares(static_cast<std::size_t>(5 * square));
  real* const from = start.data();
  real *s = squares.data(), *p = s + square, *q = p + square, *next = q + square, *spare = next + square;
  const auto factor = static_cast<real>(1 / (std::sqrt(kernels::sum_of_squares(size, x)) + 1e-7));
  kernels::each(size, [=](Dim i) { from[i] = factor * x[i]; });
  if (wide) {
    kernels::linear_grad_x(rows, rows, columns, from, from, Into::overwrite, s);
  } else {
    kernels::linear_grad_w(rows, columns, columns, from, from, Into::overwrite, s);
  }
  for (int step = 0; step < kSteps; ++step) {
    multiply(side, s, s, p);
    kernels::each(square, [=](Dim i) { p[i] = kB * s[i] + kC * p[i]; });
    for (Dim i = 0; i < side; ++i) p[i * side + i] += kA;
    if (step == 0) {
      std::copy_n(p, square, q);
    } else {
      multiply(side, q, p, next);
      std::swap(q, next);
    }
    if (step == kSteps - 1) break;
    multiply(side, p, s, spare);
    multiply(side, spare, p, s);
  }
  if (wide) {
    kernels::linear(rows, rows, columns, q, from, nullptr, 1, x);
  } else {
    kernels::linear(rows, columns, columns, from, q, nullptr, 1, x);
  }
}

}  // namespace supertac
