// What a port sends, found out by listening.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "data/sensors/sensor.h"

namespace supertac {

/// Bytes, and when they had arrived.
struct Heard {
  double time_s = 0;
  std::string bytes;
};

struct ProbeReport {
  std::vector<std::string> says;  ///< for people, a line each: what was seen, and what was only assumed
  std::optional<Sensor> draft;    ///< reads the same frames; empty where none were found
};

/// `known`: the sensor, where its file is known: the draft keeps its name, array, order and dead taxels. Else
/// the most nearly square array is assumed, and reported. `port`: goes into messages and draft. A format is
/// taken when at least nine in ten bytes are frames of it.
ProbeReport probe(std::span<const Heard> heard, const std::string& port, const std::optional<Sensor>& known);

/// Where each signal of `sensor` rests and its gain, found while each taxel is pressed about equally hard,
/// one after the other or many at once under a flat plate, and let go for more than half of the time:
///   rest    = median over time of what is sent
///   peak_k  = what the length over the channels of (sent - rest) exceeds for 0.2 s in all; of at most one
///             frame in 100, but at least three frames
///   gain_k  = median of all pressed taxels' peaks / peak_k, within 0.2 to 5
/// A taxel was pressed when its peak is over 6 times its noise (the step from frame to frame that three in
/// four stay below) and over a fifth of the peak that nine in ten taxels stay below. The others are named and
/// get gain 1. The draft is the sensor with these; empty where nothing was pressed or no frames came.
ProbeReport find_gain(std::span<const Heard> heard, const Sensor& sensor);

/// Bytes that came within so many seconds came at once, as from a file.
inline constexpr double kAtOnceS = 0.2;

}  // namespace supertac
