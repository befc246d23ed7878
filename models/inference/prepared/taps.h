// Where the taps of convolutions lie, for plans in numbers and in whole numbers.
#pragma once

#include "autograd/kernels/conv.h"
#include "autograd/variable.h"

namespace supertac {

/// Of a map: as far as the taps of all convolutions that read it reach over its edges.
struct Margin {
  Dim height = 0, width = 0;
  void widen(const kernels::ConvSettings& reader);
};

/// The outputs first, first + stride, ... of a transposed convolution along one axis: output first + stride t
/// sees the inputs t + base - j through the taps tap + stride j, j = taps - 1 ... 0.
struct Phase {
  Phase(Dim first, Dim out, Dim kernel, Dim stride, Dim padding)
      : count((out - first + stride - 1) / stride),
        tap((first + padding) % stride),
        base((first + padding) / stride),
        taps(tap < kernel ? (kernel - tap + stride - 1) / stride : 0) {}
  Dim count, tap, base, taps;
};

/// [ky][kx][cin][cout] -> the taps of these phases in the order of their inputs.
Tensor phase_weights(const kernels::ConvSettings& s, const Phase& down, const Phase& across,
                     const Variable& w);

/// The weights of a linear layer behind flatten_channels_first or before unflatten_channels_first,
/// [outer][channels][pixels][inner], take the numbers in the order in which they lie,
/// [outer][pixels][channels][inner].
Tensor with_pixels_outside(const Tensor& t, Dim outer, Dim pixels, Dim inner);

}  // namespace supertac
