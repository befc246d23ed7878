// A linear layer.
#pragma once

#include "autograd/ops/activations.h"

namespace supertac {

/// y = f(x w + b), f(s) = s for s > 0, else negative_slope s (kNoActivation: f(s) = s).  x [N,in], w
/// [in,out], b [out]; y [N,out]. Throws std::invalid_argument on other shapes and for a negative slope.
Variable linear(const Variable& x, const Variable& w, const Variable& b, real negative_slope = kNoActivation);

}  // namespace supertac
