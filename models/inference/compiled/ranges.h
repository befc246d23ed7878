// The ranges of the results of a network's ops, from which int8 takes its scales.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "layers/checkpoint.h"
#include "models/networks/supertac_model.h"

namespace supertac {

/// How whole numbers q stand for values: value = (q - zero) * step, |q| <= largest.
struct Scale {
  double step = 1;
  std::int32_t zero = 0;
  std::int32_t largest = 255;
};

/// Smallest and largest value of each op of an inference, in their order, over the inputs that were added.
class ActivationRanges {
 public:
  /// Runs the network on these inputs and widens the ranges, which begin with 0. Throws as SuperTac::draw,
  /// and std::invalid_argument for a network of another number of ops.
  void add(const SuperTac& network, const Tensor& inputs);
  /// As stored() wrote it; empty for a file without. Throws std::runtime_error naming path and tensor.
  static std::optional<ActivationRanges> read(const SafetensorsFile& file, const std::string& path);
  StoredTensor stored() const;

  std::size_t ops() const { return low_.size(); }
  /// How bytes stand for the values of an op: 0 is one of them. Throws std::out_of_range.
  Scale scale(std::size_t op) const;
  /// The largest magnitude of the values of an op. Throws std::out_of_range.
  double largest(std::size_t op) const { return std::max(-low_.at(op), high_.at(op)); }

 private:
  std::vector<float> low_, high_;
};

}  // namespace supertac
