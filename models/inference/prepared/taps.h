// What plans of fp32 and of int8 share: which op reads which value, and where the taps of convolutions lie.
#pragma once

#include <map>
#include <vector>

#include "autograd/trace.h"
#include "models/networks/network.h"

namespace supertac {

/// The margin of a map: as far as the taps of all convolutions that read it reach over its edges.
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

/// The traced ops of one inference: which op reads a value last, how wide the value's margin must be, and
/// which map's memory it shares.
class TraceWalk {
 protected:
  using Id = const detail::Node*;

  TraceWalk(const Variable& input, const std::vector<TracedOp>& ops, const Drawing& drawn);

  /// The value itself, or the map that it is the flattened form of.
  Id owner(const Variable& x) const;
  Margin margin_of(const Variable& y) const;
  /// Of the map that this value is unflattened into; 1 where it is not.
  Dim pixels_of_unflatten(const Variable& y) const;
  bool read_after(Id value, std::size_t op) const;
  /// Whether it is take_runs or last_frame. Throws std::logic_error when another op reads the network's
  /// input.
  bool takes_input(const TracedOp& op) const;

 private:
  Id input_;
  std::map<Id, Id> flattened_;
  std::map<Id, Dim> pixels_of_unflatten_;
  std::map<Id, std::size_t> last_use_;
  std::map<Id, Margin> margins_;
};

}  // namespace supertac
