// A network made ready to draw many pictures: what its module description does, noted once
// (autograd/trace.h), as a list of steps on planned memory. Weights are packed and transformed once, nothing
// is on a graph, and a warm call takes no memory from the heap and no lock.
#pragma once

#include <memory>

#include "models/inference/ranges.h"
#include "models/networks/network.h"

namespace supertac {

class Plan;

/// Draws the network's pictures up to rounding (1e-5 of the largest value). A picture has the same bits alone
/// and in any batch, on every processor. Copies share their weights; any thread may call.
class Prepared {
 public:
  /// Takes the weights as they are now. The network must outlive this: with SUPERTAC_ISA=plain its own
  /// forward step draws. Throws std::logic_error naming an op that has no step.
  explicit Prepared(const Network& network);
  /// In bytes (int8): the convolutions are exact sums of products of bytes, the pictures differ by what the
  /// ranges' steps are coarse. On every processor and in any batch they have the same bits. Throws
  /// std::invalid_argument when the ranges are another network's.
  Prepared(const Network& network, const ActivationRanges& ranges);

  const Network& network() const { return *network_; }
  /// Throws as Network::draw.
  Estimate estimate(const Tensor& inputs) const;

 private:
  const Network* network_;
  std::shared_ptr<const Plan> plan_;
};

}  // namespace supertac
