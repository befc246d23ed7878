#include "autograd/ops/activations.h"

#include "autograd/kernels/conv.h"
#include "autograd/kernels/exp.h"
#include "autograd/ops/elementwise.h"

namespace supertac {

// x, y of one shape, here and below;  y = x > 0 ? x : slope x;  gx = y > 0 ? gy : slope gy: the sign of y is
// that of x for slope >= 0.
static Variable rectify(const char* op, const Variable& x, real slope) {
  return elementwise(
      op, x, [f = kernels::Rectifier(slope)](real at) { return f(at); },
      [slope](real gy, real, real y) { return y > 0 ? gy : slope * gy; }, {.negative_slope = slope});
}

Variable relu(const Variable& x) { return rectify("relu", x, 0); }

Variable leaky_relu(const Variable& x, real negative_slope) {
  check_slope("leaky_relu", negative_slope);
  return rectify("leaky_relu", x, negative_slope);
}

void check_slope(const char* op, real slope) {
  if (!(slope >= 0)) refuse(op, "negative_slope", "0 or more", digits(slope));
}

// y = f(s) and gy of one shape;  gy becomes gs = gy f'(s) = y > 0 ? gy : slope gy (kernels::Rectifier)
const real* before_activation(Backward& g, real slope) {
  const real* y = g.y().data();
  real* gs = g.mutable_gy().data();
  if (slope != kNoActivation) each(g.gy().size(), [=](Dim i) { gs[i] = y[i] > 0 ? gs[i] : slope * gs[i]; });
  return gs;
}

// y = 1 / (1 + e^-x);  gx = gy y (1 - y)
Variable sigmoid(const Variable& x) {
  return elementwise(
      "sigmoid", x, [](real at) { return kernels::sigmoid_same_bits(at); },
      [](real gy, real, real y) { return gy * y * (1 - y); });
}

// y = min(max(x, low), high);  gx = gy within the limits, which belong to it, 0 beyond
Variable clamp(const Variable& x, real low, real high) {
  if (!(low <= high)) refuse("clamp", "low", "at most high, " + digits(high), digits(low));
  return elementwise(
      "clamp", x, [=](real at) { return at < low ? low : (at > high ? high : at); },
      [=](real gy, real at, real) { return at >= low && at <= high ? gy : 0; }, {.low = low, .high = high});
}

}  // namespace supertac
