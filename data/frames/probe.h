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

/// The frames that were heard, [signal][frame]: as Sensor::arrange() without rest and gain; without those in
/// which a signal is no number.
struct HeardFrames {
  std::vector<std::vector<float>> signals;
  std::size_t count = 0, steps = 0;
  double seconds = 0, frame_bytes = 0;  ///< of the steps in which time went on; of all whole frames
};
HeardFrames frames_of(const Sensor& sensor, std::span<const Heard> heard);

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

/// A format that may be it, and the array that its frames are.
struct FoundFormat {
  FrameFormat format;
  TaxelArray array;
  std::string remark;          ///< for people
  std::vector<int> dead = {};  ///< values that say "nan", "-" or nothing only
};
/// Columns of numbers or objects of JSON in `bytes`, which were heard for `seconds`; empty, and `says` why,
/// where they are neither.
std::optional<FoundFormat> find_text_format(const std::string& bytes, double seconds,
                                            std::vector<std::string>& says);
/// Of so many values the most nearly square array, or the one that nested lists of JSON show (`nested`: the
/// length of each, from outside), with three channels where they are threes; empty when no array has so many.
std::optional<TaxelArray> assumed_array(std::size_t values, std::span<const std::size_t> nested = {});

/// One way to read binary frames, and how few bits describe the bytes when they are read so.
struct BinaryReading {
  FrameFormat format;
  std::size_t values = 0, period = 0;  ///< numbers, and bytes, of a frame
  double bits = 0, sent = 0;           ///< of the description, and of all bytes as they came
  bool unit_assumed = false;           ///< of the clock; a file says nothing of the time it took
  bool unknown = false;                ///< some bytes are no value and have no meaning that is known
  bool mixed = false;                  ///< its fields have two byte orders
  bool sign_unsure = false;            ///< signed, though what is below 0 is the same number each time
  std::string text() const;
};
/// Of numbers of two bytes a higher one changes, and no lower one has its highest bit.
bool holds_seven_bits(const BinaryReading& reading, std::span<const Heard> heard);
/// Readings of the bytes, the best first, no two of which give the same numbers. Header (0 to 4 bytes),
/// clock, counter, type, byte order, count, checksum and what it covers, and trailer are found at once, by
/// the length of the bytes' description (binary_columns.h). `values`: how many a frame has, where that is
/// known.
std::vector<BinaryReading> binary_readings(std::span<const Heard> heard, std::optional<std::size_t> values);
/// The best reading, where it leads the second by 8 bits (256 to 1), and no reading
/// takes a part of its frames for whole ones; else empty, and `says` names both.
std::optional<BinaryReading> find_binary_format(std::span<const Heard> heard,
                                                std::optional<std::size_t> values,
                                                std::vector<std::string>& says);

/// Bytes that came within so many seconds came at once, as from a file.
inline constexpr double kAtOnceS = 0.2;

/// The unit (s) of a column of stamps, from how far it went in `seconds`: 1, 1e-3 or 1e-6; empty when it is
/// no clock. For bytes that came at once, as from a file: milliseconds where all are whole, else seconds.
std::optional<double> unit_of_clock(std::span<const double> stamps, double seconds);

}  // namespace supertac
