// Losses: scalars (rank 0). All throw std::invalid_argument on shapes that do not fit or are empty, and for a
// label outside [0,K).
#pragma once

#include <cstdint>
#include <span>

#include "autograd/variable.h"

namespace supertac {

/// mean of (x - target)^2 over all elements; x, target [...] of one shape, both may require gradients.
Variable l2_loss(const Variable& x, const Variable& target);

/// Mean structural similarity (Wang et al. 2004, eq. 13) of x and target [N,H,W,1], H, W >= 3, in a sliding
/// window,
///
///     (2 mx mt + C1) (2 cov + C2) / ((mx^2 + mt^2 + C1) (vx + vt + C2)),   m means, v variances
///
/// with K1 = 0.01, K2 = 0.03, Gaussian 11x11 window of sigma 1.5; for images below 11 pixels a uniform one of
/// 7x7, or of the largest odd side that fits; valid window positions only; averaged over positions and
/// images. Any values are taken. The range is always L = 1, that of images in [0,1]: truths whose troughs
/// reach to -1 are compared with the same C1 = (K1 L)^2 and C2 = (K2 L)^2 as all others. The gradient flows
/// into x only; the graph keeps `target` itself, which may not be written to before backward().
Variable ssim(const Variable& x, const Tensor& target);

/// -1/N sum over n of log softmax(logits[n])[labels[n]].  logits [N,K], labels in [0,K), read at
/// once.
Variable softmax_cross_entropy(const Variable& logits, std::span<const std::int32_t> labels);

}  // namespace supertac
