#include "models/training/objective.h"

#include <algorithm>

namespace supertac {
namespace {

SuperTac make_model(const SuperTacSettings& settings, std::uint64_t seed) {
  Rng rng(seed);
  return {settings, rng};
}

}  // namespace

Objective::Objective(const WindowSet& windows, const Recipe& recipe)
    : Objective((recipe.check(), check(recipe.augment, windows.array()), recipe), input_of(windows),
                windows.array(), recipe.seed) {}

Objective::Objective(const Recipe& recipe, const InputSettings& input, const TaxelArray& array,
                     std::uint64_t seed)
    : recipe_(recipe), input_(input), array_(array), model_(make_model(recipe.model, seed)) {}

BatchOutput Objective::operator()(const Batch& batch) const {
  const SuperTac::Output drawn = model_.forward(batch.inputs, eps_of(batch).span());
  BatchOutput output{supertac_loss(drawn, batch.targets, recipe_.loss), drawn.image,
                     PerGroup<Variable>(recipe_.model.groups())};
  for (std::size_t g = 0; g < output.means.size(); ++g) output.means[g] = drawn.latent[g].mean;
  return output;
}

// A group's columns of the noise; zeros without sampling.
PerGroup<Tensor> Objective::eps_of(const Batch& batch) const {
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

void Objective::augment(std::uint64_t sample, std::span<float> window) const {
  if (recipe_.augment.any()) supertac::augment(recipe_.augment, recipe_.seed, sample, window, array_);
}

}  // namespace supertac
