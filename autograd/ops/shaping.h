// Ops that move numbers without changing them. All throw std::invalid_argument on shapes that do not fit.
#pragma once

#include <span>

#include "autograd/variable.h"

namespace supertac {

/// y[n,i,j,c] = max of x over the 2x2 block (2i, 2j); an odd last row or column is left out.
/// x [N,H,W,C] -> [N,H/2,W/2,C]. Among equal values the first in row order gets the gradient.
/// A NaN anywhere in the block comes out: comparisons alone would drop it, and it would travel no further.
/// Throws std::invalid_argument unless x has rank 4 and H, W >= 2.
Variable max_pool2d(const Variable& x);

/// Joins along the last axis: [.., a], [.., b] -> [.., a + b]. Up to 8 inputs; all other axes must agree.
Variable concat(std::span<const Variable> xs);
/// Which columns take_runs() takes: from `first` on, runs of `run`, `step` apart; `width` of them, which is a
/// multiple of `run`. first >= 0, 1 <= run <= step, and x has all these columns.
struct Runs {
  Dim first, run, step, width;
};
/// y[.., k] = x[.., first + k / run * step + k % run]: [.., columns] -> [.., width]. No gradient: throws for
/// an x that requires one.
Variable take_runs(const Variable& x, const Runs& runs);
/// Windows [N,T,S] -> their last frames [N,rows,columns,channels], S = rows columns channels. No gradient:
/// throws for windows that require one.
Variable last_frame(const Variable& windows, Dim rows, Dim columns, Dim channels);

/// y[n, c P + p] = x[n,p,c], P the number of pixels: [N, P..., C] -> [N, C P], the order in which PyTorch
/// flattens [N,C,P...], so that the weights of the following linear layer mean the same there.
Variable flatten_channels_first(const Variable& x);
/// The inverse: [N, C P] -> [N, P..., C] with the given pixels, {L} or {H,W}.
Variable unflatten_channels_first(const Variable& x, std::span<const Dim> pixels);

}  // namespace supertac
