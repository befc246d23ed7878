// Windows whose signals show the surface, and how far baselines are off on them.
#pragma once

#include <cstdint>
#include <numeric>
#include <vector>

#include "data/scores/baselines.h"
#include "io/numbers/random.h"
#include "tests/data/test_recordings.h"

namespace supertac {

/// Passes over 12 mm bumps in which each taxel, scaled, shows base + per_height times the height (0 to 1)
/// under its row, and noise of that deviation.
inline WindowSet surface_windows(double base, double per_height, double noise = 0, int passes = 1) {
  WindowSet set(wide_settings());
  const Plate plate = Plate::named("bumps12");
  for (int pass = 1; pass <= passes; ++pass) {
    Recording recording = make_recording({.plate = "bumps12", .pass = pass, .frames = 900, .start_y_mm = 40});
    const RandomStream random(static_cast<std::uint64_t>(pass), 0);
    for (std::size_t i = 0; i < recording.signals.size(); ++i) {
      const double y = recording.position_mm[2 * (i / rig::kTaxels) + 1];
      const double row_mm = -4.5 + 3 * static_cast<double>(i % rig::kTaxels / 4);
      const double height = plate.height(18, y + row_mm) / plate.max_height();
      recording.signals[i] =
          static_cast<float>(3 - 2 * (base + per_height * height + noise * random.normal(i)));
    }
    set.add(recording);
  }
  return set;
}

inline std::vector<std::uint32_t> all_of(const WindowSet& set) {
  std::vector<std::uint32_t> all(set.size());
  std::iota(all.begin(), all.end(), 0U);
  return all;
}

inline double mean_error(const WindowSet& set, const std::vector<std::uint32_t>& indices,
                         const Baseline& baseline) {
  std::vector<float> out(256), truth(256);
  double sum = 0;
  for (const std::uint32_t i : indices) {
    baseline.predict(set.window(i), out);
    set.truth(i, truth);
    for (std::size_t p = 0; p < 256; ++p) sum += (out[p] - truth[p]) * (out[p] - truth[p]);
  }
  return sum / 256 / static_cast<double>(indices.size());
}

}  // namespace supertac
