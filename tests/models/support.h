// Small models and windows for the tests of models/.
#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <string>

#include "data/windows/windows.h"
#include "io/files/file.h"
#include "models/training/train.h"
#include "tests/data/test_recordings.h"
#include "tests/support/draws.h"
#include "tests/support/test.h"

namespace supertac {

inline Tensor uniform(const Shape& shape, std::uint64_t seed) {
  Tensor t(shape);
  Draws draw(seed, 1);
  for (real& x : t.values()) x = static_cast<real>(draw());
  return t;
}

/// Of the rig's array.
inline constexpr Dim kGroups = 4;

inline std::array<Tensor, kGroups> normal_eps(Dim n, Dim latent, std::uint64_t seed) {
  std::array<Tensor, kGroups> eps;
  Draws draw(seed, 2);
  for (Tensor& e : eps) {
    e = Tensor(Shape{n, latent});
    for (real& x : e.values()) x = static_cast<real>(draw.normal());
  }
  return eps;
}

inline SuperTacSettings small_settings() {
  return {.timesteps = 32, .latent = 3, .scale = 2, .channels = 8, .rcabs = 1};
}

inline SuperTac random_network(const SuperTacSettings& settings = small_settings(), std::uint64_t seed = 1) {
  Rng rng(seed);
  return SuperTac(settings, rng);
}

/// With the ranges of its values, for int8.
inline ModelFile model_of(const SuperTacSettings& settings, const InputSettings& input) {
  ModelFile file;
  file.model = std::make_unique<SuperTac>(random_network(settings, 3));
  file.input = input;
  file.ranges.emplace().add(*file.model, uniform(file.model->input_shape(16), 5));
  return file;
}

/// The parameter of this name.
inline Variable parameter_of(const Module& module, const std::string& name) {
  return std::ranges::find(module.parameters(), name, &Parameter::name)->value;
}

/// Mean and variance of all entries.
inline std::pair<double, double> moments_of(const Tensor& t) {
  double sum = 0, squares = 0;
  for (const real x : t.values()) {
    sum += static_cast<double>(x);
    squares += static_cast<double>(x) * static_cast<double>(x);
  }
  const double n = static_cast<double>(t.size()), mean = sum / n;
  return {mean, squares / n - mean * mean};
}

inline Recipe small_training() {
  Recipe s;
  s.model = small_settings();
  s.epochs = 2;
  s.batch = 8;
  s.seed = 3;
  return s;
}

/// Two short passes of a bump sliding under the array: the voltage falls where the plate is high. `spoil` may
/// change each.
inline WindowSet small_windows(const SuperTacSettings& model, std::size_t frames = 150,
                               const std::function<void(Recording&)>& spoil = {}) {
  WindowSet windows({.timesteps = static_cast<int>(model.timesteps), .scale = static_cast<int>(model.scale)});
  const Plate plate = Plate::named("3_Bumps");
  for (int trial = 1; trial <= 2; ++trial) {
    Recording r;
    r.plate = "3_Bumps";
    r.trial = trial;
    r.pass = 1;
    r.speed_mm_s = 10;
    r.source = "simulated";
    for (std::size_t i = 0; i < frames; ++i) {
      const double y = 36 + 10 * static_cast<double>(i) / 300;
      r.time_s.push_back(static_cast<double>(i) / 300);
      r.position_mm.insert(r.position_mm.end(), {18, static_cast<float>(y)});
      for (int k = 0; k < rig::kTaxels; ++k) {
        const double height = plate.height(18, y - 4.5 + 3 * (k / 4));
        r.signals.push_back(static_cast<float>(2.44 - 0.1 * height - 0.002 * ((trial + k) % 3)));
      }
    }
    if (spoil) spoil(r);
    windows.add(r);
  }
  return windows;
}

/// What a test trains; it may change the recipe before.
struct SmallTraining {
  Recipe recipe = small_training();
  WindowSet windows = small_windows(recipe.model);

  Trainer trainer() const { return {windows, all_of(windows), recipe}; }
};

inline std::string file_text(const std::string& path) { return read_text_file(path, 1 << 26); }

}  // namespace supertac
