#include "models/inference/compiled/compiled_model.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "autograd/kernels/fast/isa/isa.h"
#include "autograd/kernels/fast/pool.h"
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

static double square(real x) { return static_cast<double>(x) * static_cast<double>(x); }

Ensemble::Ensemble(std::vector<CompiledModel> members) : members_(std::move(members)) {
  if (members_.empty()) throw std::invalid_argument("Ensemble: expected at least one network, got none");
  for (const CompiledModel& member : members_)
    if (member.network().format() != first().format())
      throw std::invalid_argument("Ensemble: expected networks of one format, got one of " +
                                  text(first().format()) + " and one of " + text(member.network().format()));
}

Estimate Ensemble::estimate(const Tensor& inputs) const {
  Estimate mean = members_.front().estimate(inputs);
  if (members_.size() == 1) return mean;
  const bool predicted_error = mean.predicted_error.defined();
  const auto count = static_cast<real>(members_.size());
  const auto pixels = static_cast<std::size_t>(mean.picture.size());
  const std::size_t errors = predicted_error ? pixels : 0;
  std::vector<double, PoolAllocator<double>> squares(errors);  // a picture takes no heap
  mean.picture = mean.picture.clone();
  for (std::size_t m = 0; m < members_.size(); ++m) {
    const Estimate one = m == 0 ? mean : members_[m].estimate(inputs);
    if (one.predicted_error.defined() != predicted_error)
      throw std::invalid_argument("Ensemble: some of the networks predict their error, others do not");
    for (std::size_t i = 0; i < errors; ++i)
      squares[i] += square(one.picture.values()[i]) + square(one.predicted_error.values()[i]);
    for (std::size_t i = 0; m > 0 && i < pixels; ++i) mean.picture.values()[i] += one.picture.values()[i];
  }
  for (real& value : mean.picture.values()) value /= count;
  if (!predicted_error) return mean;
  mean.predicted_error = Tensor(mean.picture.shape());
  for (std::size_t i = 0; i < pixels; ++i)
    mean.predicted_error.values()[i] =
        static_cast<real>(std::sqrt(std::max(0.0, squares[i] / count - square(mean.picture.values()[i]))));
  return mean;
}

}  // namespace supertac
