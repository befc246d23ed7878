// 3x3 convolutions by Winograd's minimal filtering F(4x4, 3x3) (Lavin & Gray, CVPR 2016): each 4x4 square Y
// of the output comes from the 6x6 patch d of the input around it with 36 instead of 144 products,
//   Y = A^T [sum over cin of (G g G^T) * (B^T d B)] A,   * element by element.
// The 36 places of the patches are 36 matrix products [tiles, cin] x [cin, cout], which run on the same
// register tiles as everything else. Both gradients take the same way back. Rounding errors are ten times
// those of plain sums: 1e-5 of the largest value.
#pragma once

#include "autograd/kernels/fast/geometry.h"

namespace supertac::kernels {

/// Whether conv() and its gradients take this way: four images or more, of four 4x4 squares or more (8x8,
/// 4x16), channels multiples of 16. Elsewhere the transforms cost more than the products save. The shapes
/// alone decide, so that all processors agree.
bool is_winograd(const ConvTask& task);

void winograd_conv(const ConvTask& task, const real* x, const real* w, const real* bias, real negative_slope,
                   real* y);
void winograd_grad_x(const ConvTask& task, const real* gy, const real* w, Into into, real* gx);
void winograd_grad_w(const ConvTask& task, const real* x, const real* gy, Into into, real* gw);

}  // namespace supertac::kernels
