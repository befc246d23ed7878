#pragma once

#include "autograd/ops/activations.h"

namespace supertac {

/// y = f(x w + b), f as activations.h says.  x [N,in], w [in,out], b [out]; y [N,out]. Throws
/// std::invalid_argument on other shapes and for a negative slope.
Variable linear(const Variable& x, const Variable& w, const Variable& b, real negative_slope = kNoActivation);

}  // namespace supertac
