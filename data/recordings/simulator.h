#pragma once

#include <cstdint>

#include "data/plates/plate.h"
#include "data/recordings/finger_model.h"
#include "data/recordings/recording.h"

namespace supertac {

/// One pass: onset (the finger comes down), sliding along +y, release (it lifts), re-position (it moves on,
/// in the air, towards the next pass).
struct PassSettings {
  int trial = 1,
      pass = 1;  ///< pass p slides at x = rig::pass_x_mm(p), from one side of the plate to the other
  double speed_mm_s = rig::kSlideMmS;
  double from_mm = 28, to_mm = 80;  ///< the slide, of the finger's centre
};

/// A recording of one pass as the rig would make it, with the finger's true position at every time stamp.
/// Defaults over 8 passes, 2 trials, 5 and 10 mm/s and default_plates() make 465,600 frames. The position is
/// where the finger is; the moving average makes the signals trail it by 49 ms, as on the rig. Deterministic
/// in (plate, pass, settings, seed).
/// Throws std::invalid_argument on speeds, rates or paths that make no pass, and as FingerModel.
Recording simulate_pass(const Plate& plate, const PassSettings& pass, const SimulatorSettings& settings = {},
                        std::uint64_t seed = 1);

}  // namespace supertac
