#pragma once

#include <span>
#include <vector>

#include "models/files/model_file.h"
#include "models/inference/prepared.h"

namespace supertac {

/// What the products of a network are made of.
enum class Precision {
  fp32,
  int8,  ///< bytes: faster, and the pictures differ a little (models/inference/prepared.h)
};
/// "fp32" or "int8"; throws std::invalid_argument.
Precision precision_of(const std::string& name);

/// Where more of the pictures with texture are unfamiliar than this share, the plate is not one of those that
/// were trained on: so were 149 of 155 passes over bumps and ridges that were left out, and 6 of 75 over
/// known plates in the unseen trial (bench/results).
inline constexpr double kUnfamiliarShare = 0.1;

/// Several networks that draw one picture.
///
/// Those that differ in their seeds are averaged: what each of them made up where the signals leave it open
/// mostly differs, and is averaged away (Lakshminarayanan 2017).
///
/// Of networks some of which were trained beside random plates, two pictures are made: what those that know
/// the recorded plates alone *recall*, and what the others *feel*. The first is the better one of a plate
/// that was trained on, the second of any other. A window has the first while it is to be trusted with a part
/// of what the second says otherwise counted as its error,
///   doubt_of(recalled, s) < .15,   s^2 = spread of recalled^2 + (recalled - felt)^2 / 20,
/// else the second: experts with a gate (Jacobs 1991) that asks whether they agree and so need not be
/// trained. Both numbers were chosen on trial 1, for known plates to lose less than .01 (bench/results).
///
/// Costs as much as all networks.
class Committee {
 public:
  /// Of one, which must outlive this: a model is taken wherever a committee is.
  Committee(const Network& network) { recalling_.emplace_back(network); }
  /// Of all these files' models, as load_models gives them, at least one; they must outlive this. Throws
  /// std::invalid_argument when there is none, std::runtime_error when one has no ranges for less than fp32.
  explicit Committee(std::span<const ModelFile> files, Precision precision = Precision::fp32);

  const Network& first() const { return recalling_.front().network(); }
  /// The mean of the members' pictures, added in their order; spread^2 is the mean of their spread^2 plus the
  /// variance of their pictures, the latents are those of the first. Of two kinds of networks these are the
  /// figures of the kind that draws the window, and `unfamiliar` says which. Throws as Network::estimate.
  Estimate estimate(const Tensor& inputs) const;
  Tensor infer(const Tensor& inputs) const { return estimate(inputs).picture; }

 private:
  std::vector<Prepared> recalling_, feeling_;  // the second is empty where all are of one kind
};

/// The models of a committee. Throws std::runtime_error, as load_model, and naming the file that differs from
/// the first in the signals it takes or the pictures it draws, or in its network from the first of its kind.
std::vector<ModelFile> load_models(std::span<const std::string> paths, ModelKind kind = ModelKind::windows);

}  // namespace supertac
