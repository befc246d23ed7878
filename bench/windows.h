// Inputs for measurements: no recording needed, the same numbers everywhere.
#pragma once

#include <vector>

#include "data/windows/windows.h"
#include "io/numbers/random.h"
#include "models/networks/supertac_model.h"

namespace supertac::bench {

/// [n,T,16], uniform in [0,1).
inline Tensor random_windows(Dim n, Dim timesteps) {
  Tensor windows(Shape{n, timesteps, kTaxels});
  const RandomStream random(1, 1);
  std::uint64_t i = 0;
  for (real& x : windows.values()) x = static_cast<real>(random.uniform(i++));
  return windows;
}

/// A pass of 6,000 frames of a finger sliding over bumps.
inline WindowSet sliding_bumps(const SuperTacSettings& model) {
  WindowSettings settings;
  settings.timesteps = static_cast<int>(model.timesteps);
  settings.scale = static_cast<int>(model.scale);
  WindowSet windows(settings);
  const Plate plate = Plate::named("3_Bumps");
  Recording r;
  r.plate = "3_Bumps";
  r.trial = r.pass = 1;
  r.speed_mm_s = 2.5;
  r.source = "simulated";
  for (int i = 0; i < 6000; ++i) {
    const double time = i / 300.0, y = 28 + r.speed_mm_s * time;
    r.time_s.push_back(time);
    r.position_mm.insert(r.position_mm.end(), {18, static_cast<float>(y)});
    for (int k = 0; k < kTaxels; ++k)
      r.volts.push_back(static_cast<float>(2.44 - 0.1 * plate.height(18, y - 4.5 + 3 * (k / 4))));
  }
  windows.add(r);
  return windows;
}

inline std::vector<std::uint32_t> all_of(const WindowSet& windows) {
  std::vector<std::uint32_t> indices(windows.size());
  for (std::uint32_t i = 0; i < windows.size(); ++i) indices[i] = i;
  return indices;
}

}  // namespace supertac::bench
