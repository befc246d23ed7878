// A network that was compiled for drawing many pictures. Its forward pass is traced once (autograd/trace.h)
// and becomes a list of steps on planned memory. The weights are packed and transformed once, nothing is
// recorded on a graph, and a warm call neither takes memory from the heap nor waits for a lock.
#pragma once

#include <memory>

#include "models/inference/compiled/ranges.h"
#include "models/networks/supertac_model.h"

namespace supertac {

class Plan;
struct IntegerPlan;

/// Draws the network's pictures; they differ from the network's own by rounding, at most 1e-5 of the largest
/// value. A picture has the same bits alone and in any batch, on every processor. Copies share their weights,
/// and any thread may call.
class CompiledModel {
 public:
  /// Copies the weights. The network must outlive this object, because with SUPERTAC_ISA=plain the network
  /// itself draws. Throws std::logic_error that names the op where one has no step.
  explicit CompiledModel(const SuperTac& network);
  /// Computes in whole numbers (int8), by the C code of a microcontroller, which is slower here than fp32. It
  /// multiplies bytes, and numbers of 16 bits where bytes would be too coarse
  /// (models/inference/compiled/integer_plan.h). The pictures differ from fp32's by rounding to steps that
  /// follow from the ranges. They have the same bits on every processor and microcontroller, and in any
  /// batch. Throws as IntegerPlan::of().
  CompiledModel(const SuperTac& network, const ActivationRanges& ranges);

  const SuperTac& network() const { return *network_; }
  /// Throws as SuperTac::draw.
  Estimate estimate(const Tensor& inputs) const;

 private:
  const SuperTac* network_;
  std::shared_ptr<const Plan> plan_;
  std::shared_ptr<const IntegerPlan> integers_;  // instead
};

}  // namespace supertac
