#include "models/training/objective.h"

#include <algorithm>
#include <stdexcept>
namespace supertac {
namespace {

template <class Model, class Settings>
Model make_model(const Settings& settings, std::uint64_t seed) {
  Rng rng(seed);
  return Model(settings, rng);
}

class WindowObjective : public Objective {
 public:
  WindowObjective(const Recipe& recipe, const InputSettings& input, const TaxelArray& array,
                  std::uint64_t seed)
      : recipe_(recipe), input_(input), array_(array), model_(make_model<SuperTac>(recipe.model, seed)) {}

  const Network& network() const override { return model_; }
  const TrainingPace& pace() const override { return recipe_; }
  std::unique_ptr<Objective> clone() const override {
    return std::make_unique<WindowObjective>(recipe_, input_, array_, 0);
  }

  BatchOutput operator()(const Batch& batch) const override {
    const SuperTac::Output drawn = model_.forward(batch.inputs, eps_of(batch).span());
    BatchOutput output{supertac_loss(drawn, batch.targets, recipe_.loss), drawn.image,
                       PerGroup<Variable>(recipe_.model.groups())};
    for (std::size_t g = 0; g < output.means.size(); ++g) output.means[g] = drawn.latent[g].mean;
    return output;
  }
  Dim noise() const override { return recipe_.sampling ? latents() : 0; }
  Dim latents() const override { return recipe_.model.groups() * recipe_.model.latent; }
  void augment(std::uint64_t sample, std::span<float> input) const override {
    if (recipe_.augment.any()) supertac::augment(recipe_.augment, recipe_.seed, sample, input, array_);
  }

  std::string text() const override { return training_text(recipe_); }
  std::map<std::string, std::string> metadata() const override {
    return model_metadata(recipe_.model, input_);
  }

 private:
  // A group's columns of the noise; zeros without sampling.
  PerGroup<Tensor> eps_of(const Batch& batch) const {
    const Dim samples = batch.inputs.dim(0), latent = recipe_.model.latent;
    PerGroup<Tensor> eps(recipe_.model.groups());
    for (std::size_t g = 0; g < eps.size(); ++g) {
      eps[g] = Tensor::zeros(Shape{samples, latent});
      for (Dim n = 0; recipe_.sampling && n < samples; ++n) {
        const real* from = batch.noise.data() + n * latents() + static_cast<Dim>(g) * latent;
        std::copy_n(from, latent, eps[g].data() + n * latent);
      }
    }
    return eps;
  }

  Recipe recipe_;
  InputSettings input_;
  TaxelArray array_;
  SuperTac model_;
};

class FrameObjective : public Objective {
 public:
  FrameObjective(const FrameRecipe& recipe, const ChannelScaling& scaling, std::uint64_t seed)
      : recipe_(recipe), scaling_(scaling), model_(make_model<FrameModel>(recipe.model, seed)) {}

  const Network& network() const override { return model_; }
  const TrainingPace& pace() const override { return recipe_; }
  std::unique_ptr<Objective> clone() const override {
    return std::make_unique<FrameObjective>(recipe_, scaling_, 0);
  }
  BatchOutput operator()(const Batch& batch) const override {
    const Variable picture = model_.forward(Variable(batch.inputs));
    return {picture_loss(picture, batch.targets, recipe_.lambda), picture, PerGroup<Variable>()};
  }
  std::string text() const override { return training_text(recipe_); }
  std::map<std::string, std::string> metadata() const override {
    return model_metadata(recipe_.model, scaling_);
  }

 private:
  FrameRecipe recipe_;
  ChannelScaling scaling_;
  FrameModel model_;
};

}  // namespace

void Objective::augment(std::uint64_t, std::span<float>) const {}

std::unique_ptr<Objective> window_objective(const WindowSet& windows, const Recipe& recipe) {
  recipe.check();
  recipe.loss.check();
  check(recipe.augment, windows.array());
  return std::make_unique<WindowObjective>(recipe, input_of(windows), windows.array(), recipe.seed);
}

std::unique_ptr<Objective> frame_objective(const PairSet& pairs, FrameRecipe recipe) {
  recipe.check();
  if (!(recipe.lambda >= 0))
    throw std::invalid_argument("training settings: lambda must not be negative, got " +
                                std::to_string(recipe.lambda));
  const TaxelArray array = pairs.array();
  recipe.model.in_channels = array.channels;
  recipe.model.height = array.rows;
  recipe.model.width = array.columns;
  recipe.model.scale = pairs.scale();
  return std::make_unique<FrameObjective>(recipe, pairs.scaling(), recipe.seed);
}

}  // namespace supertac
