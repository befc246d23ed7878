// Sums and products.
#pragma once

#include "autograd/variable.h"

namespace supertac {

/// y = a + b, elementwise. Both throw std::invalid_argument unless the shapes are equal.
Variable add(const Variable& a, const Variable& b);
/// y = a b, elementwise.
Variable multiply(const Variable& a, const Variable& b);
/// y = factor x
Variable scale(const Variable& x, real factor);
/// The sum of all elements, a scalar (rank 0).
Variable sum(const Variable& x);

}  // namespace supertac
