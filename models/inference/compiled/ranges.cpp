// The ranges of the results of a network's ops, from which int8 takes its scales.
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "io/numbers/numbers.h"
#include "models/inference/compiled/compiled_model.h"

namespace supertac {

static const std::string kName = "int8.ranges";

void ActivationRanges::add(const SuperTac& network, const Tensor& inputs) {
  const TracedPrediction traced(network, inputs);
  const std::vector<TracedOp>& ops = traced.trace.ops();
  if (low_.empty()) low_.resize(ops.size(), 0), high_ = low_;
  if (low_.size() != ops.size())
    refuse("ActivationRanges", "network", std::to_string(low_.size()) + " ops", std::to_string(ops.size()));
  for (std::size_t i = 0; i < low_.size(); ++i) {
    for (const real value : ops[i].y.value().values()) {
      low_[i] = std::min(low_[i], static_cast<float>(value));
      high_[i] = std::max(high_[i], static_cast<float>(value));
    }
  }
}

std::optional<ActivationRanges> ActivationRanges::read(const SafetensorsFile& file) {
  const auto found = file.tensors().find(kName);
  if (found == file.tensors().end()) return {};
  const TensorInfo& info = found->second;
  if (info.dtype != "F32" || info.shape.size() != 2 || info.shape[1] != 2)
    throw std::runtime_error(file.path() + ": " + kName + " expected F32 [N,2], found " + info.dtype + " " +
                             shape_text(info.shape));
  ActivationRanges ranges;
  const std::vector<float> values = file.f32(kName);
  for (std::size_t i = 0; i + 1 < values.size(); i += 2) {
    if (!(values[i] <= 0 && values[i + 1] >= 0 && std::isfinite(values[i + 1] - values[i])))
      throw std::runtime_error(file.path() + ": " + kName + " expected finite ranges around 0, found " +
                               format(values[i]) + " to " + format(values[i + 1]));
    ranges.low_.push_back(values[i]);
    ranges.high_.push_back(values[i + 1]);
  }
  return ranges;
}

StoredTensor ActivationRanges::stored() const {
  StoredTensor stored{kName, {low_.size(), 2}, {}};
  for (std::size_t i = 0; i < low_.size(); ++i)
    stored.values.insert(stored.values.end(), {low_[i], high_[i]});
  return stored;
}

Scale ActivationRanges::scale(std::size_t op) const {
  constexpr float kSteps = 255;
  const float width = high_.at(op) - low_.at(op);
  if (!(width > 0)) return {};
  const float step = width / kSteps;
  return {step, static_cast<std::int32_t>(std::lrint(-low_[op] / step))};
}

}  // namespace supertac
