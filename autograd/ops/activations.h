// Elementwise non-linearities; any shape. All throw std::invalid_argument as their text says.
#pragma once

#include "autograd/variable.h"

namespace supertac {

/// y = max(x, 0)
Variable relu(const Variable& x);
/// y = x > 0 ? x : slope x. Throws for a negative slope.
Variable leaky_relu(const Variable& x, real slope = real(0.01));
/// y = 1 / (1 + exp(-x))
Variable sigmoid(const Variable& x);
/// y = min(max(x, low), high); the gradient passes where low <= x <= high. Throws unless low <= high.
Variable clamp(const Variable& x, real low, real high);

}  // namespace supertac
