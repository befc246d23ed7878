#pragma once

#include <algorithm>
#include <cstdint>
#include <string>

#include "data/plates/plate.h"
#include "data/recordings/simulator.h"
#include "io/random.h"

namespace supertac {

inline constexpr double kBoardHz = 1008.06;

inline Recording full_pass(const std::string& plate, int pass, std::uint64_t seed) {
  SimulatorSettings settings;
  settings.rate_hz = kBoardHz;
  settings.with_loss = false;
  return simulate_pass(Plate::named(plate), {.pass = pass, .speed_mm_s = 10, .from_mm = 0, .to_mm = 108},
                       settings, seed);
}

// Without the frames at..at + lost - 1, and with stamps that count those that are left.
inline void lose(Recording& r, std::size_t at, std::size_t lost) {
  const auto from = static_cast<std::ptrdiff_t>(at),
             to = static_cast<std::ptrdiff_t>(std::min(at + lost, r.frames()));
  r.volts.erase(r.volts.begin() + from * kTaxels, r.volts.begin() + to * kTaxels);
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

}  // namespace supertac
