#include "autograd/kernels/elementwise.h"

#include "autograd/kernels/clones.h"
#include "autograd/kernels/exp.h"
#include "autograd/kernels/parallel.h"

namespace supertac::kernels {
namespace {

SUPERTAC_CLONES void leaky_relu_loop(Dim n, real slope, const real* x, real* __restrict y) {
  for (Dim i = 0; i < n; ++i) y[i] = x[i] > 0 ? x[i] : slope * x[i];
}

SUPERTAC_CLONES void leaky_relu_grad_loop(Dim n, real slope, const real* gy, const real* y,
                                          real* __restrict gx) {
  for (Dim i = 0; i < n; ++i) gx[i] += y[i] > 0 ? gy[i] : slope * gy[i];
}

SUPERTAC_CLONES void sigmoid_loop(Dim n, const real* x, real* __restrict y) {
  for (Dim i = 0; i < n; ++i) y[i] = sigmoid_same_bits(x[i]);
}

SUPERTAC_CLONES void sigmoid_grad_loop(Dim n, const real* gy, const real* y, real* __restrict gx) {
  for (Dim i = 0; i < n; ++i) gx[i] += gy[i] * y[i] * (1 - y[i]);
}

SUPERTAC_CLONES void clamp_loop(Dim n, real low, real high, const real* x, real* __restrict y) {
  for (Dim i = 0; i < n; ++i) y[i] = x[i] < low ? low : (x[i] > high ? high : x[i]);
}

SUPERTAC_CLONES void clamp_grad_loop(Dim n, real low, real high, const real* gy, const real* x,
                                     real* __restrict gx) {
  for (Dim i = 0; i < n; ++i) gx[i] += x[i] >= low && x[i] <= high ? gy[i] : 0;
}

SUPERTAC_CLONES void add_loop(Dim n, const real* a, const real* b, real* __restrict y) {
  for (Dim i = 0; i < n; ++i) y[i] = a[i] + b[i];
}

SUPERTAC_CLONES void multiply_loop(Dim n, const real* a, const real* b, real* __restrict y) {
  for (Dim i = 0; i < n; ++i) y[i] = a[i] * b[i];
}

SUPERTAC_CLONES void scale_loop(Dim n, real factor, const real* x, real* __restrict y) {
  for (Dim i = 0; i < n; ++i) y[i] = factor * x[i];
}

SUPERTAC_CLONES void add_scaled_loop(Dim n, real factor, const real* x, real* __restrict y) {
  for (Dim i = 0; i < n; ++i) y[i] += factor * x[i];
}

SUPERTAC_CLONES void add_product_loop(Dim n, const real* a, const real* b, real* __restrict y) {
  for (Dim i = 0; i < n; ++i) y[i] += a[i] * b[i];
}

}  // namespace

void leaky_relu(Dim n, real slope, const real* x, real* y) {
  for_pieces(n, [=](Dim i, Dim end) { leaky_relu_loop(end - i, slope, x + i, y + i); });
}
void leaky_relu_grad(Dim n, real slope, const real* gy, const real* y, real* gx) {
  for_pieces(n, [=](Dim i, Dim end) { leaky_relu_grad_loop(end - i, slope, gy + i, y + i, gx + i); });
}
void sigmoid(Dim n, const real* x, real* y) {
  for_pieces(n, [=](Dim i, Dim end) { sigmoid_loop(end - i, x + i, y + i); });
}
void sigmoid_grad(Dim n, const real* gy, const real* y, real* gx) {
  for_pieces(n, [=](Dim i, Dim end) { sigmoid_grad_loop(end - i, gy + i, y + i, gx + i); });
}
void clamp(Dim n, real low, real high, const real* x, real* y) {
  for_pieces(n, [=](Dim i, Dim end) { clamp_loop(end - i, low, high, x + i, y + i); });
}
void clamp_grad(Dim n, real low, real high, const real* gy, const real* x, real* gx) {
  for_pieces(n, [=](Dim i, Dim end) { clamp_grad_loop(end - i, low, high, gy + i, x + i, gx + i); });
}
void add(Dim n, const real* a, const real* b, real* y) {
  for_pieces(n, [=](Dim i, Dim end) { add_loop(end - i, a + i, b + i, y + i); });
}
void multiply(Dim n, const real* a, const real* b, real* y) {
  for_pieces(n, [=](Dim i, Dim end) { multiply_loop(end - i, a + i, b + i, y + i); });
}
void scale(Dim n, real factor, const real* x, real* y) {
  for_pieces(n, [=](Dim i, Dim end) { scale_loop(end - i, factor, x + i, y + i); });
}
void add_scaled(Dim n, real factor, const real* x, real* y) {
  for_pieces(n, [=](Dim i, Dim end) { add_scaled_loop(end - i, factor, x + i, y + i); });
}
void add_product(Dim n, const real* a, const real* b, real* y) {
  for_pieces(n, [=](Dim i, Dim end) { add_product_loop(end - i, a + i, b + i, y + i); });
}

double sum(Dim n, const real* x) {
  return sum_pieces(n, [x](Dim begin, Dim end) {
    return sum_lanes(begin, end, [x](Dim i) { return static_cast<double>(x[i]); });
  });
}
double sum_of_squares(Dim n, const real* x) {
  return sum_pieces(n, [x](Dim begin, Dim end) {
    return sum_lanes(begin, end,
                     [x](Dim i) { return static_cast<double>(x[i]) * static_cast<double>(x[i]); });
  });
}

}  // namespace supertac::kernels
