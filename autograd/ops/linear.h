#pragma once

#include "autograd/variable.h"

namespace supertac {

/// y = x w + b.  x [N,in], w [in,out], b [out]; y [N,out]. Throws std::invalid_argument on other shapes.
Variable linear(const Variable& x, const Variable& w, const Variable& b);

}  // namespace supertac
