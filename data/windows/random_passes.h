// Simulated passes that training sees beside recorded ones.
#pragma once

#include <cstdint>

#include "data/windows/windows.h"

namespace supertac {

/// Simulated passes over random plates, for networks that are to feel what they were never trained on.
struct RandomPasses {
  std::size_t count = 0;
  std::uint64_t seed = 0;
  double speed_mm_s = rig::kSlideMmS;
  double filter_s =
      rig::kFilterS;           ///< of the moving average, as the recordings beside them have it; 0 = none
  bool other_fingers = false;  ///< no two alike, for recordings of real fingers
};

/// The first number of a random plate (random_plate()) that training uses; smaller ones are for tests.
constexpr std::uint32_t kFirstTrainingPlate = 1'000'000;

/// Adds `count` passes, each over a plate of its own with a mounting of its own: gains, tilt, depth, and
/// where the slide begins and ends are drawn about what the rig's passes show. With other_fingers mount, dome
/// and pad are drawn as well, for each taxel the load below which it feels nothing, and how much the finger
/// rocks on its way. They are for training only: no split tests them. Computed when called, on all
/// threads. A pure function of the arguments.
void add_random_passes(WindowSet& windows, const RandomPasses& passes);

/// Adds passes in which nothing is felt, over a plain plate: taxel k, scaled, stands at
///   x_k(t) = level_k + drift_k t + noise,
/// with levels from nothing to the whole range, drifts of up to a tenth of it in a window and noise of up to
/// a twentieth, all drawn for each pass. They have a tenth as many windows as there are already, 2,400 at
/// most unless `many`: where fingers differ and a faint signal may be a texture, the whole tenth, and those
/// beyond 2,400 are of a finger that hardly touches. Without them networks drew textures on signals that
/// stand, drift or are noisy (bench/results/sensor_faults.md): normalised windows show one finger's noise as
/// large as another's texture. For training only, like random passes, and not in_distribution(): an alarm
/// must not take them for what a finger feels. Of the windows' array, rate and range. A pure function of the
/// arguments.
void add_silent_passes(WindowSet& windows, std::uint64_t seed, bool many = false);

}  // namespace supertac
