// What plans of fp32 and of int8 share: which op reads which value, and where the taps of convolutions lie.
#pragma once

#include <algorithm>
#include <map>
#include <vector>

#include "autograd/kernels/fast/inference.h"
#include "autograd/trace.h"
#include "models/networks/supertac_model.h"

namespace supertac {

/// The margin of a map: as far as the taps of all convolutions that read it reach over its edges.
struct Margin {
  Dim height = 0, width = 0;
  void widen(const kernels::ConvSettings& reader);
};

/// Where a value lies in the workspace: images [height][width][channels] with a margin of zeros around.
struct FeatureMap {
  Dim height = 1, width = 1, channels = 1;
  Dim margin_h = 0, margin_w = 0;
  Dim offset = 0;  ///< of the first image, per image of a block

  Dim line() const { return (width + 2 * margin_w) * channels; }
  Dim image() const { return (height + 2 * margin_h) * line(); }
  /// From an image's beginning to its first pixel.
  Dim origin() const { return margin_h * line() + margin_w * channels; }
  kernels::Strides strides() const { return {image(), line(), channels}; }
  bool operator==(const FeatureMap&) const = default;
  bool same_layout(FeatureMap other) const { return other.offset = offset, *this == other; }
};

/// Fills the margins of so many images of a map, of which `image` is the first.
template <class T>
void fill_margin(const FeatureMap& map, Dim images, T value, T* image) {
  if (map.margin_h + map.margin_w == 0) return;
  const Dim ends = map.margin_h * map.line(), side = map.margin_w * map.channels;
  for (T* const last = image + images * map.image(); image < last; image += map.image()) {
    std::fill_n(image, ends, value);
    std::fill_n(image + map.image() - ends, ends, value);
    for (T* line = image + ends; line < image + map.image() - ends; line += map.line()) {
      std::fill_n(line, side, value);
      std::fill_n(line + map.line() - side, side, value);
    }
  }
}

/// What a map takes of the network's input: for each pixel, runs of `run` numbers from `first` on, `apart`
/// from one to the next; a pixel's first number is `step` behind that of the one before.
struct InputRuns {
  Dim first = 0, run = 0, apart = 0, step = 0;
  static InputRuns of(const TracedOp& op);  ///< take_runs or last_frame
};

/// A convolution, every second pixel of a transposed one, or a linear layer as a product: w
/// [segments * length][cout] times the runs of `length` numbers that begin `segments` behind an output's
/// place.
struct ProductTaps {
  Dim height = 1, width = 1;
  kernels::Strides from = {}, to = {};
  std::vector<Dim> segments = {};
  Dim length = 0;
  Dim y_offset = 0;  ///< from the map's first pixel
  Tensor w = {}, bias = {};
};

/// The traced ops of one inference: which op reads a value last, how its map lies, and which map's memory it
/// shares.
class TraceWalk {
 protected:
  using Id = const detail::Node*;

  explicit TraceWalk(const TracedPrediction& traced);

  /// The value itself, or the map that it is the flattened form of.
  Id owner(const Variable& x) const;
  /// The map that a value becomes, with the margin that its readers need; its offset is not set.
  FeatureMap layout_of(const Variable& y) const;
  /// Those of a convolution or linear layer, from map to map.
  std::vector<ProductTaps> products_of(const TracedOp& op, const FeatureMap& x, const FeatureMap& y) const;
  bool read_after(Id value, std::size_t op) const;
  /// Whether it is take_runs or last_frame. Throws std::logic_error when another op reads the network's
  /// input.
  bool takes_input(const TracedOp& op) const;

 private:
  ProductTaps linear(const TracedOp& op, const FeatureMap& x, const FeatureMap& y) const;

  Id input_;
  std::map<Id, Id> flattened_;
  std::map<Id, Dim> pixels_of_unflatten_;  // of the map that a value is unflattened into
  std::map<Id, std::size_t> last_use_;
  std::map<Id, Margin> margins_;
};

}  // namespace supertac
