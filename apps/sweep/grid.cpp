#include "apps/sweep/grid.h"

#include <functional>

#include "apps/train/training_options.h"

namespace supertac {
namespace {

std::vector<Dim> whole_numbers(const Arguments& a, const std::string& name) {
  std::vector<Dim> all;
  for (const double value : a.numbers(name, 0, 1e9)) {
    all.push_back(static_cast<Dim>(value));
    if (static_cast<double>(all.back()) != value)
      throw UsageError("--" + name + " expects whole numbers, found " + a.text(name));
  }
  return all;
}

// The listed values, or the preset's own.
std::vector<Dim> values(const Arguments& a, const std::string& name, Dim otherwise) {
  return a.given(name) ? whole_numbers(a, name) : std::vector<Dim>{otherwise};
}

struct Axis {
  const char* option;
  Dim SuperTacSettings::*setting;
};
constexpr Axis kAxes[] = {{"timesteps", &SuperTacSettings::timesteps},
                          {"scale", &SuperTacSettings::scale},
                          {"latent", &SuperTacSettings::latent},
                          {"channels", &SuperTacSettings::channels},
                          {"rcabs", &SuperTacSettings::rcabs}};

void expand(const Arguments& a, std::size_t axis, SuperTacSettings settings,
            const std::function<void(const SuperTacSettings&)>& use) {
  if (axis == std::size(kAxes)) return use(settings);
  const auto& [option, setting] = kAxes[axis];
  for (const Dim value : values(a, option, settings.*setting)) {
    settings.*setting = value;
    expand(a, axis + 1, settings, use);
  }
}

}  // namespace

std::string model_name_of(const Recipe& recipe) {
  const auto part = [](const char* letter, Dim value) { return letter + std::to_string(value); };
  const SuperTacSettings& m = recipe.model;
  return m.preset + part("_t", m.timesteps) + part("_l", m.latent) + part("_x", m.scale) +
         part("_c", m.channels) + part("_r", m.rcabs) + "_s" + std::to_string(recipe.seed);
}

void declare_grid(Arguments& a) {
  a.option("preset", "A,B,...", "recipes to start from: paper, best, tiny, frame", "paper");
  a.option("timesteps", "T,...",
           "samples per window, multiples of 16, 32 to 512, or 1 (default: the preset's)");
  a.option("latent", "LD,...", "latent numbers per group of taxels (default: the preset's)");
  a.option("scale", "N,...", "pictures N times as fine as the array: 2, 4, 8, 16 (default: the preset's)");
  a.option("seeds", "N,...", "of split, initial weights, order, noise", "0");
  a.more();
  a.option("channels", "N,...", "of the upsampler (default: the preset's)");
  a.option("rcabs", "N,...", "residual channel attention blocks per stage (default: the preset's)");
  a.more(false);
}

std::vector<Recipe> grid_of(const Arguments& a) {
  std::vector<Recipe> grid;
  as_usage([&] {
    for (const std::string& preset : a.list("preset")) {
      Recipe recipe = recipe_of(a, Recipe::named(preset));
      expand(a, 0, recipe.model, [&](const SuperTacSettings& settings) {
        recipe.model = settings;
        recipe.check();
        for (const Dim seed : whole_numbers(a, "seeds")) {
          recipe.seed = static_cast<std::uint64_t>(seed);
          grid.push_back(recipe);
        }
      });
    }
  });
  if (grid.empty()) throw UsageError("the grid is empty: give --preset and --seeds at least one value");
  return grid;
}

}  // namespace supertac
