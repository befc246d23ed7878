#pragma once

#include <algorithm>
#include <cstdint>
#include <string>

#include "data/plates/plate.h"
#include "data/simulation/simulator.h"
#include "io/numbers/random.h"

namespace supertac {

inline constexpr double kBoardHz = 1008.06;

inline void append_frame(Recording& to, const Recording& from, std::size_t i, double time_s) {
  to.time_s.push_back(time_s);
  const std::size_t signals = from.array.signals();
  for (std::size_t s = 0; s < signals; ++s) to.signals.push_back(from.signals[i * signals + s]);
  for (std::size_t axis = 0; axis < 2; ++axis) to.position_mm.push_back(from.position_mm[2 * i + axis]);
}

// The rig's text files hold the slide and little of what was before and behind it: no frame of the air.
inline Recording slide_of(const Recording& whole) {
  constexpr float kTouchingMm = 0.75F;
  Recording slide = whole;
  slide.time_s.clear(), slide.signals.clear(), slide.position_mm.clear(), slide.lift_mm.clear();
  double begin = -1;
  for (std::size_t i = 0; i < whole.frames(); ++i) {
    if (whole.lift_mm[i] > kTouchingMm) continue;
    if (begin < 0) begin = whole.time_s[i];
    append_frame(slide, whole, i, whole.time_s[i] - begin);
  }
  return slide;
}

inline Recording full_pass(const std::string& plate, int pass, std::uint64_t seed, double speed = 10,
                           double lost_fraction = 0) {
  SimulatorSettings settings;
  settings.rate_hz = kBoardHz;
  settings.lost_fraction = lost_fraction;
  return slide_of(simulate_pass(Plate::named(plate), {.pass = pass, .speed_mm_s = speed}, settings, seed));
}

// Without the frames at..at + lost - 1, and with stamps that count those that are left.
inline void lose(Recording& r, std::size_t at, std::size_t lost) {
  const auto from = static_cast<std::ptrdiff_t>(at),
             to = static_cast<std::ptrdiff_t>(std::min(at + lost, r.frames())),
             signals = static_cast<std::ptrdiff_t>(r.array.signals());
  r.signals.erase(r.signals.begin() + from * signals, r.signals.begin() + to * signals);
  r.position_mm.erase(r.position_mm.begin() + from * 2, r.position_mm.begin() + to * 2);
  r.time_s.resize(r.frames() - static_cast<std::size_t>(to - from));
}

// As the rig's text files have it: the host reads chunks of 29 frames, and behind a fifth of them, more in
// the second quarter of the pass, it lost up to 24.
inline Recording lossy_pass(const std::string& plate, int pass, std::uint64_t seed) {
  Recording r = full_pass(plate, pass, seed);
  const RandomStream random(seed, static_cast<std::uint64_t>(pass));
  for (std::size_t at = 29, chunk = 0; at < r.frames(); at += 29, ++chunk) {
    const double part = static_cast<double>(at) / static_cast<double>(r.frames());
    if (random.uniform(2 * chunk) < (part > 0.25 && part < 0.5 ? 0.6 : 0.2))
      lose(r, at, static_cast<std::size_t>(24 * random.uniform(2 * chunk + 1)));
  }
  return r;
}

inline constexpr double kLineHz = 812;

// A simulated pass over the whole plate as the rig's text files have it: 29 frames of 36 kept, no time stamps
// but the nominal ones. The true positions stay with the frames for comparison.
inline Recording like_the_rig(const std::string& plate, int pass, std::uint64_t seed, double late_s = 0,
                              double early_s = 0, double speed = 10) {
  const Recording full = full_pass(plate, pass, seed, speed, SimulatorSettings().lost_fraction);
  Recording text = full;
  text.time_s.clear(), text.signals.clear(), text.position_mm.clear();
  text.source = "imported";
  for (std::size_t i = 0; i < full.frames(); ++i) {
    if (i % 36 >= 29 || full.time_s[i] < late_s || full.time_s[i] > full.time_s.back() - early_s) continue;
    append_frame(text, full, i, static_cast<double>(text.time_s.size()) / kLineHz);
  }
  return text;
}

}  // namespace supertac
