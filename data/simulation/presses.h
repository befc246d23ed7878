// Presses of an array, simulated: recordings whose truth is the pressure on its surface.
#pragma once

#include <cstdint>
#include <string>

#include "data/recordings/recording.h"

namespace supertac {

struct Presses {
  std::string kind = "disc";  ///< of press_kinds()
  int number = 1;             ///< of the recording: others of its kind have other scenes
  int count = 100;
  int scale = 4;  ///< truth that many times as fine as the array
};

/// Frames of each press, at random times of it.
constexpr int kFramesOfAPress = 6;

/// `count` presses, one after the other, each with a Scene of its own. With p the scene's pressure, which is
/// the truth (clipped to 1), signal k is
///   load_k   = mean of p over the taxel, under the skin: a bell of Body::sigma_mm() around it
///   signal_k = rest - span (response(load))_k + noise, cut to the range,
/// of the sensor's body (BodyResponse) and scale. Three axes have this for z; x and y lean away from the
/// pressure, as in FingerModel without drag, and rest in the middle of the range unless the file says where.
/// What the body's file does not say is drawn for each press - a skin that spreads by .15 to .6 pitches,
/// noise of .2 to 1 % of the range - and so is what it knows with an uncertainty; every press is up to a
/// quarter weaker or stronger, and every taxel 5 % by itself. Silent taxels are filled as live ones are. The
/// recording has truth, group and plate (the kind) and source "simulated". Deterministic in (sensor, presses,
/// seed), on any processor. Throws std::invalid_argument for an unknown kind, a scale other than 2, 4, 8 or
/// 16, or an array of other than one or three channels.
Recording simulate_presses(const Sensor& sensor, const Presses& presses, std::uint64_t seed);

/// Somebody presses here and there for so long: scenes as of simulate_presses(), of 0.4 to 2.5 s, at the
/// sensor's rate, by objects of a range of sizes that is drawn once: who has thick fingers keeps them. No
/// truth. Deterministic in (sensor, seconds, seed).
Recording simulate_touching(const Sensor& sensor, double seconds, std::uint64_t seed);

}  // namespace supertac
