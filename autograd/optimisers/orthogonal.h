// The orthogonal factor of a matrix, by products alone.
#pragma once

#include "autograd/tensor.h"

namespace supertac {

/// x [rows, columns] <- nearly U V^T, where U S V^T is its singular value decomposition, by five steps of
/// Newton and Schulz from X = x / (|x| + 1e-7), |x| being the L2 norm of all elements:
///
///     X <- a X + b (X X^T) X + c (X X^T)^2 X,   a = 3.4445, b = -4.7750, c = 2.0315
///
/// (Jordan et al. 2024, "Muon: An optimizer for hidden layers in neural networks"). They bring singular
/// values above .01 |x| to between .6 and 1.3; these coefficients are fast and do not converge to 1. All
/// steps are polynomials of the smaller of X X^T and X^T X and are taken on that.
void orthogonalise(Dim rows, Dim columns, real* x);

}  // namespace supertac
