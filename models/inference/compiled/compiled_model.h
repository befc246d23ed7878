// A network that was compiled for drawing many pictures. Its forward pass is traced once (autograd/trace.h)
// and becomes a list of steps on planned memory. The weights are packed and transformed once, nothing is
// recorded on a graph, and a warm call neither takes memory from the heap nor waits for a lock. Ensemble
// averages several of them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "layers/checkpoint.h"
#include "models/networks/supertac_model.h"

namespace supertac {

class Plan;
struct IntegerPlan;

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
  static std::optional<ActivationRanges> read(const SafetensorsFile& file);
  StoredTensor stored() const;

  std::size_t ops() const { return low_.size(); }
  /// How bytes stand for the values of an op: 0 is one of them. Throws std::out_of_range.
  Scale scale(std::size_t op) const;
  /// The largest magnitude of the values of an op. Throws std::out_of_range.
  double largest(std::size_t op) const { return std::max(-low_.at(op), high_.at(op)); }

 private:
  std::vector<float> low_, high_;
};

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

/// Several networks that draw one picture, the mean of theirs: where the signals leave the picture open,
/// networks of different seeds mostly err differently, which averages out (Lakshminarayanan et al. 2017).
/// Costs as much as all of them. The networks must outlive it.
class Ensemble {
 public:
  /// Throws std::invalid_argument when there is none, or when they differ in the inputs that they take or in
  /// the pictures that they draw.
  explicit Ensemble(std::vector<CompiledModel> members);

  const SuperTac& first() const { return members_.front().network(); }
  /// The members' pictures are added in their order. predicted_error^2 is the mean of their predicted_error^2
  /// plus the variance of their pictures, the latents are those of the first. Throws as
  /// SuperTac::estimate, and std::invalid_argument when some predict their error and others do not.
  Estimate estimate(const Tensor& inputs) const;
  Tensor infer(const Tensor& inputs) const { return estimate(inputs).picture; }

 private:
  std::vector<CompiledModel> members_;
};

}  // namespace supertac
