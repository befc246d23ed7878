// Elementwise non-linearities; y has the shape of x, any. All throw std::invalid_argument for an empty
// Variable.
#pragma once

#include "autograd/variable.h"

namespace supertac {

/// Convolutions and linear layers apply f(s) = s for s > 0, else negative_slope * s, as they store their
/// result: forward this saves a pass over memory, backward it saves keeping s.
inline constexpr real kNoActivation = 1, kRelu = 0, kLeakyRelu = real(0.01);

/// y = max(x, 0). At 0 the gradient is 0.
Variable relu(const Variable& x);
/// y = x > 0 ? x : negative_slope x. At 0 the gradient is negative_slope gy. Throws for a negative slope.
Variable leaky_relu(const Variable& x, real negative_slope = kLeakyRelu);
/// y = 1 / (1 + exp(-x))
Variable sigmoid(const Variable& x);
/// y = min(max(x, low), high); the gradient passes where low <= x <= high. Throws unless low <= high.
Variable clamp(const Variable& x, real low, real high);

}  // namespace supertac
