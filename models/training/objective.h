// What a network is trained on: from a batch to the named terms of its loss. SuperTac learns from windows, a
// frame model from pairs; Trainer (models/training/trainer.h) knows neither.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>

#include "data/windows/pairs.h"
#include "data/windows/windows.h"
#include "models/files/model_file.h"
#include "models/networks/frame_model.h"
#include "models/training/recipe.h"

namespace supertac {

/// One batch, or a micro-batch's share of it.
struct Batch {
  Tensor inputs, targets;
  Tensor noise;  ///< [N,Objective::noise()], ~ N(0,1)
};

/// Of a batch: the loss, and what tells a collapse (models/training/loss/collapse.h).
struct BatchOutput {
  Loss loss;
  Variable picture;
  PerGroup<Variable> means;  ///< of the latents, [N,LD] each; none for a network without latents
};

class Objective {
 public:
  virtual ~Objective() = default;
  virtual const Network& network() const = 0;
  virtual const TrainingPace& pace() const = 0;
  /// The same over a network of its own, which awaits the values of this one's parameters.
  virtual std::unique_ptr<Objective> clone() const = 0;

  virtual BatchOutput operator()(const Batch& batch) const = 0;
  /// Numbers of noise and of latents that a sample has.
  virtual Dim noise() const { return 0; }
  virtual Dim latents() const { return 0; }
  /// Changes an input in training: a function of the sample's number since training began.
  virtual void augment(std::uint64_t sample, std::span<float> input) const;

  /// Its settings as JSON text, to compare on resume.
  virtual std::string text() const = 0;
  /// What the checkpoint says of the network and its input.
  virtual std::map<std::string, std::string> metadata() const = 0;
};

/// supertac_loss of windows that are augmented before. Throws std::invalid_argument naming the setting.
std::unique_ptr<Objective> window_objective(const WindowSet& windows, const Recipe& recipe);

/// Of pairs as they are scaled now. The model's sizes and scale become the pairs'. Throws
/// std::invalid_argument naming the setting.
std::unique_ptr<Objective> frame_objective(const PairSet& pairs, FrameRecipe recipe);

}  // namespace supertac
