// Structural similarity (Wang, Bovik, Sheikh, Simoncelli 2004) and its gradient, callable without a graph.
#pragma once

#include "autograd/tensor.h"

namespace supertac::kernels {

inline constexpr Dim kSmallestSsimImage = 3;

struct ImageSizes {
  Dim images, height, width;
};

/// The mean over images and valid window positions of x, target [images, height, width]; sides are at least
/// kSmallestSsimImage. See autograd/ops/losses.h for window and constants.
double ssim(const ImageSizes& sizes, const real* x, const real* target);
/// gx += g * d ssim / d x
void ssim_grad(const ImageSizes& sizes, real g, const real* x, const real* target, real* gx);

}  // namespace supertac::kernels
