// Building blocks for the sources of ops and their reverse steps; any shape.
#pragma once

#include <utility>

#include "autograd/kernels/fast/each.h"
#include "autograd/record.h"
#include "autograd/trace.h"

namespace supertac {

using kernels::each;

/// gx[i] = or += term(i) where that input wants a gradient.
template <class Term>
void add_to_gradient(Backward& g, std::size_t input, Term term) {
  kernels::each_into(g.value(input).size(), g.slot_of(input), term);
}

/// For the ops that end in f (ops/activations.cpp has both): refuses a negative slope.
void check_slope(const char* op, real negative_slope);
/// For their reverse steps: replaces g's dL/dy by dL/ds = dL/dy f'(s), f' taken from the sign of y, and
/// returns it.
const real* before_activation(Backward& g, real negative_slope);

/// y[i] = value(x[i]);   gx[i] = or += gradient(gy[i], x[i], y[i])
/// `gradient` is copied into the node. Both call nothing that the C library rounds (kernels/exp.h), and
/// capture numbers alone: a captured tensor would be kept for as long as the graph.
template <class Value, class Gradient>
Variable elementwise(const char* op, const Variable& x, Value value, Gradient gradient,
                     const OpSettings& settings = {}) {
  check_defined(op, "x", x);
  Tensor y(x.shape());
  each(y.size(), [=, from = x.value().data(), to = y.data()](Dim i) { to[i] = value(from[i]); });
  const auto reverse = [gradient](Backward& g) {
    const real *gy = g.gy().data(), *from = g.value(0).data(), *to = g.y().data();
    add_to_gradient(g, 0, [=](Dim i) { return gradient(gy[i], from[i], to[i]); });
  };
  return record(op, std::move(y), {&x}, reverse, &settings);
}

}  // namespace supertac
