// The largest of two by two pixels.
#pragma once

#include "autograd/variable.h"

namespace supertac {

/// y[n,i,j,c] = max of x over the 2x2 block (2i, 2j); an odd last row or column is left out.
/// x [N,H,W,C] -> [N,H/2,W/2,C]. Among equal values the first in row order gets the gradient.
/// A NaN anywhere in the block comes out: comparisons alone would drop it, and it would travel no further.
/// Throws std::invalid_argument unless x has rank 4 and H, W >= 2.
Variable max_pool2d(const Variable& x);

}  // namespace supertac
