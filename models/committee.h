#pragma once

#include <span>
#include <vector>

#include "models/model_file.h"

namespace supertac {

/// Networks that differ in their seeds and whose pictures are averaged: what each of them made up where the
/// signals leave it open mostly differs, and is averaged away (Lakshminarayanan 2017). Costs as much as all
/// of them.
class Committee {
 public:
  /// Of one, which must outlive this: a model is taken wherever a committee is.
  Committee(const Network& network) : members_{&network} {}
  /// Of all these files' models, at least one; they must outlive this. Throws std::invalid_argument when
  /// there is none.
  explicit Committee(std::span<const ModelFile> files);

  const Network& first() const { return *members_.front(); }
  /// The mean of the members' pictures, added in their order; spread^2 is the mean of their spread^2 plus the
  /// variance of their pictures, the latents are those of the first. Throws as Network::estimate.
  Estimate estimate(const Tensor& inputs) const;
  Tensor infer(const Tensor& inputs) const { return estimate(inputs).picture; }

 private:
  std::vector<const Network*> members_;
};

/// The models of a committee. Throws std::runtime_error, as load_model, and naming the file that differs from
/// the first in its network or in the signals it takes.
std::vector<ModelFile> load_models(std::span<const std::string> paths, ModelKind kind = ModelKind::windows);

}  // namespace supertac
