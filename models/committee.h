#pragma once

#include <span>
#include <vector>

#include "models/model_file.h"
#include "models/prepared/prepared.h"

namespace supertac {

/// What the products of a network are made of.
enum class Precision {
  fp32,
  int8,  ///< bytes: faster, and the pictures differ a little (models/prepared/prepared.h)
};
/// "fp32" or "int8"; throws std::invalid_argument.
Precision precision_of(const std::string& name);

/// Networks that differ in their seeds and whose pictures are averaged: what each of them made up where the
/// signals leave it open mostly differs, and is averaged away (Lakshminarayanan 2017). Costs as much as all
/// of them.
class Committee {
 public:
  /// Of one, which must outlive this: a model is taken wherever a committee is.
  Committee(const Network& network) { members_.emplace_back(network); }
  /// Of all these files' models, at least one; they must outlive this. Throws std::invalid_argument when
  /// there is none, std::runtime_error when one has no ranges for less than fp32.
  explicit Committee(std::span<const ModelFile> files, Precision precision = Precision::fp32);

  const Network& first() const { return members_.front().network(); }
  /// The mean of the members' pictures, added in their order; spread^2 is the mean of their spread^2 plus the
  /// variance of their pictures, the latents are those of the first. Throws as Network::estimate.
  Estimate estimate(const Tensor& inputs) const;
  Tensor infer(const Tensor& inputs) const { return estimate(inputs).picture; }

 private:
  std::vector<Prepared> members_;
};

/// The models of a committee. Throws std::runtime_error, as load_model, and naming the file that differs from
/// the first in its network or in the signals it takes.
std::vector<ModelFile> load_models(std::span<const std::string> paths, ModelKind kind = ModelKind::windows);

}  // namespace supertac
