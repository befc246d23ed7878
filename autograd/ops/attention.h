// The two halves of channel attention (Zhang et al. 2018, RCAN, eq. 6-9): look at each channel's mean, scale
// the channels.
#pragma once

#include "autograd/variable.h"

namespace supertac {

/// y[n,c] = mean over h, w of x[n,h,w,c].  x [N,H,W,C] -> [N,C].
/// Both throw std::invalid_argument on other ranks or shapes.
Variable global_mean(const Variable& x);
/// y[n,h,w,c] = x[n,h,w,c] s[n,c].  x [N,H,W,C], s [N,C].
Variable scale_channels(const Variable& x, const Variable& s);

}  // namespace supertac
