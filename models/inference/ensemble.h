#pragma once

#include <vector>

#include "models/inference/prepared/prepared.h"

namespace supertac {

/// Several networks that draw one picture, the mean of theirs: what each made up where the signals leave it
/// open mostly differs between seeds, and is averaged away (Lakshminarayanan 2017). Costs as much as all of
/// them.
class Ensemble {
 public:
  /// Throws std::invalid_argument when there is none, or when they differ in the inputs that they take or in
  /// the pictures that they draw.
  explicit Ensemble(std::vector<Prepared> members);

  const Network& first() const { return members_.front().network(); }
  /// The members' pictures are added in their order. predicted_error^2 is the mean of their predicted_error^2
  /// plus the variance of their pictures, the latents are those of the first. Throws as Network::estimate,
  /// and std::invalid_argument when some predict their error and others do not.
  Estimate estimate(const Tensor& inputs) const;
  Tensor infer(const Tensor& inputs) const { return estimate(inputs).picture; }

 private:
  std::vector<Prepared> members_;
};

}  // namespace supertac
