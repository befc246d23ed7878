// The two halves of a block with channel attention (Zhang et al. 2018, RCAN, sections 3.3 and 3.4): look at
// each channel's mean; scale the channels and add what the block began with.
#pragma once

#include "autograd/variable.h"

namespace supertac {

/// y[n,c] = mean over h, w of x[n,h,w,c].  x [N,H,W,C] -> [N,C].
/// Both throw std::invalid_argument on other ranks or shapes, global_mean() for maps without a pixel.
Variable global_mean(const Variable& x);
/// y[n,h,w,c] = a[n,h,w,c] + x[n,h,w,c] s[n,c].  a, x [N,H,W,C], s [N,C]. One op, because every byte of
/// these maps that is written and read again costs inference as much as ten products.
Variable gated_sum(const Variable& a, const Variable& x, const Variable& s);

}  // namespace supertac
