#pragma once

#include <string>
#include <vector>

#include "models/inference/compiled/compiled_model.h"

namespace supertac {

/// "32 frame(s) of 4x4 taxels with 1 channel(s) and pictures of 16x16", for messages.
std::string text(const NetworkFormat& format);

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
