// Between which values the results of a network's ops lie: what a network prepared in bytes needs to know.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "autograd/kernels/fast/int8/int8.h"
#include "layers/checkpoint.h"
#include "models/networks/network.h"

namespace supertac {

/// Smallest and largest value of each op of an inference, in their order, over the inputs that were added.
class ActivationRanges {
 public:
  /// Runs the network on these inputs.
  void add(const Network& network, const Tensor& inputs);
  /// As stored() wrote it; nothing for a file without. Throws std::runtime_error naming path and tensor.
  static std::optional<ActivationRanges> read(const SafetensorsFile& file, const std::string& path);
  StoredTensor stored() const;

  std::size_t ops() const { return low_.size(); }
  /// The bytes that stand for the values of an op: 0 is one of them. Throws std::out_of_range.
  kernels::Steps steps(std::size_t op) const;

 private:
  std::vector<float> low_, high_;
};

}  // namespace supertac
