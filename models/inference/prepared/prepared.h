// A network made ready to draw many pictures: its forward pass, traced once (autograd/trace.h), becomes a
// list of steps on planned memory. Weights are packed and transformed once, nothing is on a graph, and a warm
// call takes no memory from the heap and no lock.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "models/inference/prepared/ranges.h"
#include "models/networks/network.h"

namespace supertac {

class Plan;
struct IntegerPlan;

/// Called with each map of one window, [height,width,channels], as soon as it is computed: the step
/// ("conv2d", of int8 "encoder.0.conv.1"), and its values, those of int8 converted to real numbers.
using StepWatch = std::function<void(const std::string& step, const Tensor& map)>;

/// Draws the network's pictures up to rounding (1e-5 of the largest value). A picture has the same bits alone
/// and in any batch, on every processor. Copies share their weights; any thread may call.
class Prepared {
 public:
  /// Takes the weights as they are now. The network must outlive this: with SUPERTAC_ISA=plain its own
  /// forward step draws. Throws std::logic_error naming an op that has no step.
  explicit Prepared(const Network& network);
  /// In whole numbers (int8), as on a microcontroller and no faster than it takes there: products of bytes,
  /// and numbers of 16 bits where bytes would be too coarse (models/inference/prepared/integer_plan.h). The
  /// pictures differ from fp32's by rounding to steps that follow from the ranges. They have the same bits on
  /// every processor, a microcontroller too, and in any batch. Throws as IntegerPlan::of().
  Prepared(const Network& network, const ActivationRanges& ranges);

  const Network& network() const { return *network_; }
  /// Throws as Network::draw.
  Estimate estimate(const Tensor& inputs) const;
  /// The same of one window; `watch` sees every map on the way, which is another step's where its memory has
  /// been reused. With SUPERTAC_ISA=plain it sees none of fp32. Throws std::invalid_argument for more windows
  /// than one.
  Estimate watched(const Tensor& input, const StepWatch& watch) const;

 private:
  Estimate run(const Tensor& inputs, const StepWatch* watch) const;

  const Network* network_;
  std::shared_ptr<const Plan> plan_;
  std::shared_ptr<const IntegerPlan> integers_;  // instead
};

}  // namespace supertac
