// Sums and products.
#pragma once

#include "autograd/variable.h"

namespace supertac {

/// y[i] = a[i] + b[i], a[i] - b[i], a[i] b[i]; nothing is broadcast. They throw std::invalid_argument unless
/// the shapes are equal, and all ops here for an empty Variable.
Variable operator+(const Variable& a, const Variable& b);
Variable operator-(const Variable& a, const Variable& b);
Variable operator*(const Variable& a, const Variable& b);
/// y[i] = factor x[i] and y[i] = number - x[i]; x of any shape.
Variable operator*(real factor, const Variable& x);
Variable operator-(real number, const Variable& x);

/// The sum of all elements, a scalar (rank 0), added up in double precision; 0 of none.
Variable sum(const Variable& x);

}  // namespace supertac
