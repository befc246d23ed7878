// Sums over n elements, callable without a graph.
#pragma once

#include <span>

#include "autograd/tensor.h"

namespace supertac::kernels {

/// y = the sum of all parts (at least one) as a balanced binary tree: neighbours, then pairs of pairs; -0
/// becomes +0. y may be the first of the parts, and no other.
void add_as_tree(Dim n, std::span<const real* const> parts, real* y);
/// The sum of the squares of all elements in double precision.
double sum_of_squares(Dim n, const real* x);

}  // namespace supertac::kernels
