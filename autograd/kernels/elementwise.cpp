#include "autograd/kernels/elementwise.h"

#include "autograd/kernels/exp.h"
#include "autograd/kernels/parallel.h"

namespace supertac::kernels {
namespace {

// Calls f(i) for every element; a piece's loop is what the compiler vectorises.
template <class F>
void for_each_element(Dim n, F f) {
  for_pieces(n, [f](Dim begin, Dim end) {
    for (Dim i = begin; i < end; ++i) f(i);
  });
}

}  // namespace

void leaky_relu(Dim n, real slope, const real* x, real* __restrict y) {
  for_each_element(n, [=](Dim i) { y[i] = x[i] > 0 ? x[i] : slope * x[i]; });
}
void leaky_relu_grad(Dim n, real slope, const real* gy, const real* y, real* __restrict gx) {
  for_each_element(n, [=](Dim i) { gx[i] += y[i] > 0 ? gy[i] : slope * gy[i]; });
}

void sigmoid(Dim n, const real* x, real* __restrict y) {
  for_each_element(n, [=](Dim i) { y[i] = sigmoid_same_bits(x[i]); });
}
void sigmoid_grad(Dim n, const real* gy, const real* y, real* __restrict gx) {
  for_each_element(n, [=](Dim i) { gx[i] += gy[i] * y[i] * (1 - y[i]); });
}

void clamp(Dim n, real low, real high, const real* x, real* __restrict y) {
  for_each_element(n, [=](Dim i) { y[i] = x[i] < low ? low : (x[i] > high ? high : x[i]); });
}
void clamp_grad(Dim n, real low, real high, const real* gy, const real* x, real* __restrict gx) {
  for_each_element(n, [=](Dim i) { gx[i] += x[i] >= low && x[i] <= high ? gy[i] : 0; });
}

void add(Dim n, const real* a, const real* b, real* __restrict y) {
  for_each_element(n, [=](Dim i) { y[i] = a[i] + b[i]; });
}
void multiply(Dim n, const real* a, const real* b, real* __restrict y) {
  for_each_element(n, [=](Dim i) { y[i] = a[i] * b[i]; });
}
void scale(Dim n, real factor, const real* x, real* __restrict y) {
  for_each_element(n, [=](Dim i) { y[i] = factor * x[i]; });
}
void add_scaled(Dim n, real factor, const real* x, real* __restrict y) {
  for_each_element(n, [=](Dim i) { y[i] += factor * x[i]; });
}
void add_product(Dim n, const real* a, const real* b, real* __restrict y) {
  for_each_element(n, [=](Dim i) { y[i] += a[i] * b[i]; });
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
