// A network that was compiled for drawing many pictures. Its forward pass is traced once (autograd/trace.h)
// and becomes a list of steps on planned memory. The weights are packed and transformed once, nothing is
// recorded on a graph, and a warm call neither takes memory from the heap nor waits for a lock.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "models/inference/compiled/ranges.h"
#include "models/networks/network.h"

namespace supertac {

class Plan;
struct IntegerPlan;

/// Called with each map of one window, [height,width,channels], as soon as it is computed: the step
/// ("conv2d", of int8 "encoder.0.conv.1"), and its values, those of int8 converted to real numbers.
using StepWatch = std::function<void(const std::string& step, const Tensor& map)>;

/// Draws the network's pictures; they differ from the network's own by rounding, at most 1e-5 of the largest
/// value. A picture has the same bits alone and in any batch, on every processor. Copies share their weights,
/// and any thread may call.
class CompiledModel {
 public:
  /// Copies the weights. The network must outlive this object, because with SUPERTAC_ISA=plain the network
  /// itself draws. Throws std::logic_error that names the op where one has no step.
  explicit CompiledModel(const Network& network);
  /// Computes in whole numbers (int8), by the C code of a microcontroller, which is slower here than fp32. It
  /// multiplies bytes, and numbers of 16 bits where bytes would be too coarse
  /// (models/inference/compiled/integer_plan.h). The pictures differ from fp32's by rounding to steps that
  /// follow from the ranges. They have the same bits on every processor and microcontroller, and in any
  /// batch. Throws as IntegerPlan::of().
  CompiledModel(const Network& network, const ActivationRanges& ranges);

  const Network& network() const { return *network_; }
  /// Throws as Network::draw.
  Estimate estimate(const Tensor& inputs) const;
  /// Estimates one window and calls `watch` with every map as soon as a step has computed it; later steps may
  /// reuse the map's memory. In fp32 with SUPERTAC_ISA=plain there are no steps, and `watch` is not called.
  /// Throws std::invalid_argument for more than one window.
  Estimate watched(const Tensor& input, const StepWatch& watch) const;

 private:
  Estimate run(const Tensor& inputs, const StepWatch* watch) const;

  const Network* network_;
  std::shared_ptr<const Plan> plan_;
  std::shared_ptr<const IntegerPlan> integers_;  // instead
};

}  // namespace supertac
