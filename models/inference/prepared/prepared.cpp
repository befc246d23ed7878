#include "models/inference/prepared/prepared.h"

#include <stdexcept>

#include "autograd/kernels/fast/isa/isa.h"
#include "models/inference/prepared/integer_plan.h"
#include "models/inference/prepared/planner.h"

namespace supertac {

Prepared::Prepared(const Network& network) : network_(&network) {
  if (!kernels::is_plain()) plan_ = Planner::plan(network);
}

Prepared::Prepared(const Network& network, const ActivationRanges& ranges)
    : network_(&network), integers_(IntegerPlan::of(network, ranges)) {}

Estimate Prepared::estimate(const Tensor& inputs) const { return run(inputs, nullptr); }

Estimate Prepared::watched(const Tensor& input, const StepWatch& watch) const {
  if (input.rank() < 1 || input.dim(0) != 1)
    throw std::invalid_argument("Prepared: one window is watched, got " + input.shape().text());
  return run(input, &watch);
}

Estimate Prepared::run(const Tensor& inputs, const StepWatch* watch) const {
  if (plan_ == nullptr && integers_ == nullptr) return network_->estimate(inputs);
  if (inputs.rank() < 1 || inputs.shape() != network_->input_shape(inputs.dim(0)))
    throw std::invalid_argument("Prepared: inputs expects " + network_->input_shape(0).text() +
                                " with any first size, got " + inputs.shape().text());
  return integers_ ? integers_->run(inputs, watch) : plan_->run(inputs, watch);
}

}  // namespace supertac
