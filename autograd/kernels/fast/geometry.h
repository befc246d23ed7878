// Which input pixel meets which output pixel under which tap of a convolution.
//
// Convolution, transposed convolution, both of their gradients and the linear layer all compute
//     y[n, q, :] += sum over taps t, pixels p = source(t, q):   x[n, p, :] * w[t, :, :]
// and differ only in source(). That table is built once for each geometry and kept.
#pragma once

#include <cstdint>
#include <vector>

#include "autograd/kernels/conv.h"

namespace supertac::kernels {

/// Outputs that use the same taps. A convolution has one phase; a transposed one has one for each
/// step of its strides: s * s in two dimensions, s in one.
struct Phase {
  std::vector<std::int32_t> taps;     // ascending
  std::vector<std::int32_t> outputs;  // ascending pixel numbers
  /// [outputs][taps]: the input pixel, or -1 where the tap reaches into the padding
  std::vector<std::int32_t> sources;
};

/// The pairs (input pixel, output pixel) that one tap joins, in ascending output order.
struct TapPairs {
  std::vector<std::int32_t> inputs;
  std::vector<std::int32_t> outputs;
};

struct Geometry {
  std::vector<Phase> forward;   // outputs gather from inputs
  std::vector<Phase> backward;  // inputs gather from outputs: the gradient of x
  std::vector<TapPairs> pairs;  // [taps]: the gradient of w
};

/// The table of these settings, built at first use and kept. Any thread may call it.
const Geometry& geometry_of(const ConvSettings& settings);

}  // namespace supertac::kernels
