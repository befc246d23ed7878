// Structural similarity, callable without a graph. It checks nothing.
#pragma once

#include "autograd/tensor.h"

namespace supertac::kernels {

/// The sum over images and their mean over window positions of the similarity of x and target, both [images,
/// height, width], whose shorter side is 3 or more (autograd/ops/losses.h).
double ssim(Dim images, Dim height, Dim width, const real* x, const real* target);
/// gx = or += g times its derivative by x.
void ssim_grad(Dim images, Dim height, Dim width, real g, const real* x, const real* target, Slot gx);

}  // namespace supertac::kernels
