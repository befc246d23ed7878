// Convolutions (cross-correlations, as everywhere in deep learning), channels-last.
//
// A weight lies in memory as [kernel..., in, out], so that the output channels of one tap are side by
// side; checkpoints hold PyTorch's layout (layers/checkpoint.h).
#pragma once

#include "autograd/ops/activations.h"

namespace supertac {

struct ConvOptions {
  Dim stride = 1;                       // 1 to 4096
  Dim padding = 0;                      // zeros on every side, 0 to 4096
  real negative_slope = kNoActivation;  // of f(s) = s for s > 0, else negative_slope s; 0 or more
};

/// y[n,l,o] = f(b[o] + sum over k, i of x[n, l stride + k - padding, i] w[k,i,o])
/// x [N,L,in], w [K,in,out], b [out]; y [N, (L + 2 padding - K) / stride + 1, out].
/// All four throw std::invalid_argument with the shapes when a rank, a shape, a channel count (1 to 4096), an
/// option or the output size is impossible, and of Shape when the output would have more than 2^40 elements.
Variable conv1d(const Variable& x, const Variable& w, const Variable& b, const ConvOptions& options);
/// The same over two dimensions: x [N,H,W,in], w [K,K,in,out] (the two kernel sizes may differ), b [out]; y
/// [N,H',W',out], each side as conv1d's.
Variable conv2d(const Variable& x, const Variable& w, const Variable& b, const ConvOptions& options);

/// y[n,t,o] = f(b[o] + sum over l, k with l stride + k - padding = t, and over i, of x[n,l,i] w[k,i,o]): the
/// transpose of conv1d as a linear map, plus b, then f.
/// x [N,L,in], w [K,in,out], b [out]; y [N, (L - 1) stride - 2 padding + K, out]. Kernels that the stride
/// divides (4 for stride 2) cover every output equally often: no checkerboard.
Variable conv_transpose1d(const Variable& x, const Variable& w, const Variable& b,
                          const ConvOptions& options);
/// The same over two dimensions, with the shapes of conv2d and each side as conv_transpose1d's.
Variable conv_transpose2d(const Variable& x, const Variable& w, const Variable& b,
                          const ConvOptions& options);

}  // namespace supertac
