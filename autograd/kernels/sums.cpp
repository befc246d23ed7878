#include "autograd/kernels/sums.h"

#include <algorithm>
#include <array>
#include <bit>

#include "autograd/kernels/fast/each.h"

namespace supertac::kernels {

namespace {

constexpr Dim kTreeBlock = 1024;  // so that what the tree adds up on its way stays in the first cache

// The left half of the tree is a whole one: as many parts as the largest power of two below their number.
void add_block(Dim n, Dim at, std::span<const real* const> parts, real* y) {
  const real* const a = parts[0] + at;
  if (parts.size() == 1) {
    std::copy_n(a, n, y);
    return;
  }
  if (parts.size() == 8) {  // eight micro-batches: eight streams that are fetched side by side
    const real *b = parts[1] + at, *c = parts[2] + at, *d = parts[3] + at;
    const real *e = parts[4] + at, *f = parts[5] + at, *g = parts[6] + at, *h = parts[7] + at;
    return each(n, [=](Dim i) { y[i] = ((a[i] + b[i]) + (c[i] + d[i])) + ((e[i] + f[i]) + (g[i] + h[i])); });
  }
  const std::size_t left = std::bit_ceil(parts.size()) / 2;
  std::array<real, kTreeBlock> right;
  add_block(n, at, parts.first(left), y);
  add_block(n, at, parts.subspan(left), right.data());
  const real* other = right.data();
  each(n, [=](Dim i) { y[i] += other[i]; });
}

}  // namespace

void add_as_tree(Dim n, std::span<const real* const> parts, real* y) {
  for (Dim at = 0; at < n; at += kTreeBlock) {
    const Dim count = std::min(kTreeBlock, n - at);
    add_block(count, at, parts, y + at);
    each(count, [to = y + at](Dim i) { to[i] += 0; });  // -0 becomes +0
  }
}

double sum_of_squares(Dim n, const real* x) {
  return sum_of(n, [=](Dim i) { return static_cast<double>(x[i]) * static_cast<double>(x[i]); });
}

}  // namespace supertac::kernels
