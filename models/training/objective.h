// What a network is trained on: from a batch of windows to the named terms of its loss.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>

#include "data/windows/windows.h"
#include "models/files/model_file.h"
#include "models/training/recipe.h"

namespace supertac {

/// One batch, or a micro-batch's share of it.
struct Batch {
  Tensor inputs, targets;  ///< as SuperTac::input_shape() and picture_shape() have it
  /// [N,Objective::noise()], ~ N(0,1), LD columns a group; undefined without sampling: z = mean.
  Tensor noise;
};

/// Of a batch: the loss, and what tells a collapse (models/training/loss/collapse.h).
struct BatchOutput {
  Loss loss;
  Variable picture;
  PerGroup<Variable> means;  ///< of the latents, [N,LD] each; none for a network without latents
};

/// supertac_loss() of a recipe's network over windows that are augmented before.
class Objective {
 public:
  /// For windows of this format. Throws std::invalid_argument naming the setting of the recipe.
  Objective(const WindowSet& windows, const Recipe& recipe);
  const SuperTac& network() const { return model_; }
  const Recipe& recipe() const { return recipe_; }
  /// The same with a network of its own, not yet with this one's values.
  Objective clone() const { return {recipe_, input_, array_, Rng::zeros()}; }

  BatchOutput operator()(const Batch& batch) const;
  /// How many numbers of noise and of latents a sample has.
  Dim noise() const { return recipe_.sampling ? latents() : 0; }
  Dim latents() const { return recipe_.model.latents(); }
  /// Augments a window in place; `sample` is its number since training began.
  void augment(std::uint64_t sample, std::span<float> window) const;

  /// Its settings as JSON text, to compare on resume.
  std::string text() const { return training_text(recipe_); }
  /// What the checkpoint says of the network and its input.
  std::map<std::string, std::string> metadata() const { return model_metadata(recipe_.model, input_); }

 private:
  Objective(const Recipe& recipe, const InputSettings& input, const TaxelArray& array, Rng rng);
  PerGroup<Tensor> eps_of(const Batch& batch) const;

  Recipe recipe_;
  InputSettings input_;
  TaxelArray array_;
  SuperTac model_;
};

}  // namespace supertac
