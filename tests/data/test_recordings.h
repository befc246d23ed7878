#pragma once

#include <numeric>
#include <string>

#include "data/recordings/recording.h"
#include "data/windows/windows.h"
#include "io/numbers/numbers.h"

namespace supertac {

/// The plates of the rig.
inline const std::vector<std::string> kRigPlates = {"3_Bumps", "6_Bumps", "4_Ridges", "6_Ridges",
                                                    "4_Waves", "6_Waves", "4_Blob",   "6_Blob"};

/// What a test wants to know of a recording: frame i of taxel k holds a voltage that tells i and k apart.
struct PassPlan {
  std::string plate = "bumps12";
  int trial = 1, pass = 1;
  std::size_t frames = 100;
  double rate_hz = 300;
  double start_y_mm = 30, speed_mm_s = 10;
  float level = 2.0F;  ///< volts of frame 0, taxel 0
};

inline Recording make_recording(const PassPlan& plan) {
  Recording recording;
  recording.plate = plan.plate;
  recording.trial = plan.trial;
  recording.pass = plan.pass;
  recording.speed_mm_s = plan.speed_mm_s;
  recording.source = "simulated";
  for (std::size_t i = 0; i < plan.frames; ++i) {
    const double t = static_cast<double>(i) / plan.rate_hz;
    recording.time_s.push_back(t);
    for (int k = 0; k < rig::kTaxels; ++k)
      recording.signals.push_back(plan.level + 0.001F * static_cast<float>(i) +
                                  0.0001F * static_cast<float>(k));
    recording.position_mm.push_back(18.0F);
    recording.position_mm.push_back(static_cast<float>(plan.start_y_mm + plan.speed_mm_s * t));
  }
  return recording;
}

/// As the rig's authors kept a pass: a line of text a frame.
inline std::string text_of(const Recording& recording) {
  const std::size_t signals = recording.array.signals();
  std::string text;
  for (std::size_t i = 0; i < recording.signals.size(); ++i)
    text += format(recording.signals[i]) + (i % signals == signals - 1 ? "\n" : " ");
  return text;
}

/// The numbers of all windows of a set.
inline std::vector<std::uint32_t> all_of(const WindowSet& set) {
  std::vector<std::uint32_t> all(set.size());
  std::iota(all.begin(), all.end(), 0U);
  return all;
}

/// Scales so that the voltages above stay apart: x = 1 - (V - 1) / 2, roughly.
inline WindowSettings wide_settings(int timesteps = 16) {
  WindowSettings settings;
  settings.timesteps = timesteps;
  settings.scaling = {.rest = 3.0, .span = 2.0};
  return settings;
}

}  // namespace supertac
