#include "models/training/objective.h"

#include <algorithm>
#include <stdexcept>

namespace supertac {
namespace {

const Recipe& checked(const Recipe& recipe, const TaxelArray& array) {
  recipe.check();
  check(recipe.augment, array);
  return recipe;
}

}  // namespace

Objective::Objective(const WindowSet& windows, const Recipe& recipe)
    : Objective(checked(recipe, windows.array()), input_of(windows), windows.array(), Rng(recipe.seed)) {}

Objective::Objective(const Recipe& recipe, const InputSettings& input, const TaxelArray& array, Rng rng)
    : recipe_(recipe), input_(input), array_(array), model_(recipe.model, rng) {}

BatchOutput Objective::operator()(const Batch& batch) const {
  const SuperTac::Output drawn = model_.forward(batch.inputs, eps_of(batch).span());
  BatchOutput output{supertac_loss(drawn, batch.targets, recipe_.loss), drawn.picture,
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
