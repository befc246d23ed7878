// Sums and products.
#pragma once

#include "autograd/variable.h"

namespace supertac {

/// Elementwise. All throw std::invalid_argument unless the shapes are equal.
Variable operator+(const Variable& a, const Variable& b);
Variable operator-(const Variable& a, const Variable& b);
Variable operator*(const Variable& a, const Variable& b);
/// y[i] = factor x[i] and y[i] = number - x[i].
Variable operator*(real factor, const Variable& x);
Variable operator-(real number, const Variable& x);

/// The sum of all elements, a scalar (rank 0).
Variable sum(const Variable& x);

}  // namespace supertac
