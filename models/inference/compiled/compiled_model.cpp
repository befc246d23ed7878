#include "models/inference/compiled/compiled_model.h"

#include <stdexcept>

#include "autograd/kernels/fast/isa/isa.h"
#include "models/inference/compiled/compiler.h"
#include "models/inference/compiled/integer_plan.h"

namespace supertac {

CompiledModel::CompiledModel(const SuperTac& network) : network_(&network) {
  if (!kernels::is_plain()) plan_ = Compiler::plan(network);
}

CompiledModel::CompiledModel(const SuperTac& network, const ActivationRanges& ranges)
    : network_(&network), integers_(IntegerPlan::of(network, ranges)) {}

Estimate CompiledModel::estimate(const Tensor& inputs) const {
  if (plan_ == nullptr && integers_ == nullptr) return network_->estimate(inputs);
  if (inputs.rank() < 1 || inputs.shape() != network_->input_shape(inputs.dim(0)))
    throw std::invalid_argument("CompiledModel: inputs expects " + network_->input_shape(0).text() +
                                " with any first size, got " + inputs.shape().text());
  return integers_ ? integers_->run(inputs) : plan_->run(inputs);
}

}  // namespace supertac
