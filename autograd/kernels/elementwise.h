// Loops over single elements that others than ops need besides, callable without a graph.
#pragma once

#include <span>

#include "autograd/tensor.h"

namespace supertac::kernels {

/// y = 1 / (1 + e^-x)
void sigmoid(Dim n, const real* x, real* y);
/// y += factor * x
void add_scaled(Dim n, real factor, const real* x, real* y);
/// y = 0 + the sum of all parts as a balanced binary tree: neighbours, then pairs of pairs. At least one
/// part.
void add_as_tree(Dim n, std::span<const real* const> parts, real* y);
/// The sum of the squares of all elements in double precision.
double sum_of_squares(Dim n, const real* x);

}  // namespace supertac::kernels
