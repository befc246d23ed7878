#include "autograd/kernels/elementwise.h"

#include <algorithm>
#include <array>
#include <bit>

#include "autograd/kernels/exp.h"
#include "autograd/kernels/fast/loops.h"
#include "autograd/kernels/fast/sums.h"

namespace supertac::kernels {

void leaky_relu(Dim n, real slope, const real* x, real* y) {
  each(n, [=](Dim i) SUPERTAC_LOOP { y[i] = x[i] > 0 ? x[i] : slope * x[i]; });
}

void leaky_relu_grad(Dim n, real slope, const real* gy, const real* y, real* gx) {
  each(n, [=](Dim i) SUPERTAC_LOOP { gx[i] += y[i] > 0 ? gy[i] : slope * gy[i]; });
}

void rectify_in_place(Dim n, real slope, const real* y, real* g) {
  each(n, [=](Dim i) SUPERTAC_LOOP { g[i] = y[i] > 0 ? g[i] : slope * g[i]; });
}

void sigmoid(Dim n, const real* x, real* y) {
  each(n, [=](Dim i) SUPERTAC_LOOP { y[i] = sigmoid_same_bits(x[i]); });
}

void sigmoid_grad(Dim n, const real* gy, const real* y, real* gx) {
  each(n, [=](Dim i) SUPERTAC_LOOP { gx[i] += gy[i] * y[i] * (1 - y[i]); });
}

void clamp(Dim n, real low, real high, const real* x, real* y) {
  each(n, [=](Dim i) SUPERTAC_LOOP { y[i] = x[i] < low ? low : (x[i] > high ? high : x[i]); });
}

void clamp_grad(Dim n, real low, real high, const real* gy, const real* x, real* gx) {
  each(n, [=](Dim i) SUPERTAC_LOOP { gx[i] += x[i] >= low && x[i] <= high ? gy[i] : 0; });
}

void sample_gaussian(Dim n, const real* mean, const real* log_var, const real* eps, real* z) {
  each(n, [=](Dim i) SUPERTAC_LOOP { z[i] = mean[i] + exp_same_bits(log_var[i] / 2) * eps[i]; });
}

void sample_gaussian_grad_log_var(Dim n, const real* gz, const real* z, const real* mean, real* g) {
  each(n, [=](Dim i) SUPERTAC_LOOP { g[i] += gz[i] * (z[i] - mean[i]) / 2; });
}

void add(Dim n, const real* a, const real* b, real* y) {
  each(n, [=](Dim i) SUPERTAC_LOOP { y[i] = a[i] + b[i]; });
}

void multiply(Dim n, const real* a, const real* b, real* y) {
  each(n, [=](Dim i) SUPERTAC_LOOP { y[i] = a[i] * b[i]; });
}

void scale(Dim n, real factor, const real* x, real* y) {
  each(n, [=](Dim i) SUPERTAC_LOOP { y[i] = factor * x[i]; });
}

void add_scaled(Dim n, real factor, const real* x, real* y) {
  each(n, [=](Dim i) SUPERTAC_LOOP { y[i] += factor * x[i]; });
}

namespace {

constexpr Dim kTreeBlock = 1024;  // so that what the tree adds up on its way stays in the first cache

// The left half of the tree is a whole one: as many parts as the largest power of two below their number.
void add_block(Dim n, Dim at, std::span<const real* const> parts, real* y) {
  if (parts.size() == 1) return put(n, parts[0] + at, Into::overwrite, y);
  if (parts.size() == 2) return add(n, parts[0] + at, parts[1] + at, y);
  if (parts.size() == 8) {  // a batch's lanes: eight streams that are fetched side by side
    const real *a = parts[0] + at, *b = parts[1] + at, *c = parts[2] + at, *d = parts[3] + at;
    const real *e = parts[4] + at, *f = parts[5] + at, *g = parts[6] + at, *h = parts[7] + at;
    return each(n, [=](Dim i) SUPERTAC_LOOP {
      y[i] = ((a[i] + b[i]) + (c[i] + d[i])) + ((e[i] + f[i]) + (g[i] + h[i]));
    });
  }
  const std::size_t left = std::bit_ceil(parts.size()) / 2;
  std::array<real, kTreeBlock> right;
  add_block(n, at, parts.first(left), y);
  add_block(n, at, parts.subspan(left), right.data());
  const real* other = right.data();
  each(n, [=](Dim i) SUPERTAC_LOOP { y[i] += other[i]; });
}

}  // namespace

void add_as_tree(Dim n, std::span<const real* const> parts, real* y) {
  for (Dim at = 0; at < n; at += kTreeBlock) {
    const Dim count = std::min(kTreeBlock, n - at);
    add_block(count, at, parts, y + at);
    add_constant(count, 0, y + at);  // -0 becomes +0
  }
}

void put(Dim n, const real* x, Into into, real* y) {
  if (into == Into::add) return add_scaled(n, 1, x, y);
  std::copy_n(x, n, y);
}

void add_constant(Dim n, real x, real* y) {
  each(n, [=](Dim i) SUPERTAC_LOOP { y[i] += x; });
}

void add_product(Dim n, const real* a, const real* b, real* y) {
  each(n, [=](Dim i) SUPERTAC_LOOP { y[i] += a[i] * b[i]; });
}

double sum(Dim n, const real* x) {
  return sum_lanes(n, [x](Dim i) { return static_cast<double>(x[i]); });
}

double sum_of_squares(Dim n, const real* x) {
  return sum_lanes(n, [x](Dim i) { return static_cast<double>(x[i]) * static_cast<double>(x[i]); });
}

}  // namespace supertac::kernels
