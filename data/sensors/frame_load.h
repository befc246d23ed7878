// What a whole frame says of a touch.
#pragma once

#include <cstddef>
#include <span>

#include "data/sensors/sensor.h"

namespace supertac {

struct FrameLoad {
  /// Sum over the taxels of share = (rest - signal) / span, 1 for a taxel at the end of its range; of several
  /// channels sqrt(sum of share^2), which has no sign. A force in no unit: how hard a share presses differs
  /// from array to array, and a taxel at its end hides what is beyond.
  double total_force = 0;
  std::size_t saturated = 0;  ///< signals with |share| >= 1
};

/// Of a frame [taxels][channels], in the unit of `scale`.
FrameLoad load_of(std::span<const float> signals, int channels, const SignalScale& scale);

}  // namespace supertac
