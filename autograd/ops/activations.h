// Elementwise non-linearities; any shape. What throws, throws std::invalid_argument.
#pragma once

#include "autograd/variable.h"

namespace supertac {

/// Convolutions and linear layers apply f(s) = s for s > 0, else negative_slope * s, as they store their
/// result, which saves a pass over memory forward, and backward a map.
inline constexpr real kNoActivation = 1, kRelu = 0, kLeakyRelu = real(0.01);

/// y = max(x, 0). At 0 the gradient is 0.
Variable relu(const Variable& x);
/// y = x > 0 ? x : slope x. At 0 the gradient is slope gy. Throws for a negative slope.
Variable leaky_relu(const Variable& x, real slope = kLeakyRelu);
/// For the ops that end in f: throws std::invalid_argument for a negative slope.
void check_slope(const char* op, real negative_slope);
/// For reverse steps: replaces g's dL/dy by dL/ds = dL/dy f'(s), f' taken from the sign of y, and returns it.
const real* before_activation(Backward& g, real negative_slope);

/// y = 1 / (1 + exp(-x))
Variable sigmoid(const Variable& x);
/// y = min(max(x, low), high); the gradient passes where low <= x <= high. Throws unless low <= high.
Variable clamp(const Variable& x, real low, real high);

}  // namespace supertac
