#pragma once

#include <cstdint>

#include "data/plates/plate.h"
#include "data/recordings/recording.h"
#include "data/simulation/finger_model.h"

namespace supertac {

/// One pass, as palpation programs move: onset (the finger comes down from rig::kLiftMm), sliding along +y,
/// release (it lifts), re-position (it moves back and on, in the air, to where the next pass begins).
struct PassSettings {
  int trial = 1,
      pass = 1;  ///< pass p slides at x = rig::pass_x_mm(p), from one side of the plate to the other
  double speed_mm_s = rig::kSlideMmS;
  double from_mm = 0, to_mm = rig::kPlateLengthMm;  ///< the slide, of the finger's centre
};

/// A recording of one pass as the rig would make it, with the finger's true position at every time stamp.
/// The position is where the finger is; the moving average makes the signals trail it by 49 ms, as on the
/// rig. With SimulatorSettings::wander = w the finger rocks on its way: its slopes across and along are
/// w n(y), its height is 4 mm w n(y), each with an n of its own: a sum of smooth noises 40, 20, ... 1.25 mm
/// long whose variances halve, of deviation .85. Deterministic in (plate, pass, settings, seed).
/// Throws std::invalid_argument on speeds, rates or paths that make no pass, and as FingerModel.
Recording simulate_pass(const Plate& plate, const PassSettings& pass, const SimulatorSettings& settings = {},
                        std::uint64_t seed = 1);

}  // namespace supertac
