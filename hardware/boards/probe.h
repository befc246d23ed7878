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

/// `array`: the sensor's, where it is known; else the most nearly square one is assumed, and reported.
/// `port`: goes into messages and draft. A format is taken when at least nine in ten bytes are frames of it.
ProbeReport probe(std::span<const Heard> heard, const std::string& port,
                  const std::optional<TaxelArray>& array);

/// The binary format of `bytes`, which were heard for `seconds`: header (what stays the same from period to
/// period), time stamp, type, byte order, checksum; and how many values a frame has. Empty where the bytes
/// have no period.
struct BinaryFinding {
  FrameFormat format;
  std::size_t values = 0;
};
std::optional<BinaryFinding> find_binary_format(const std::string& bytes, double seconds,
                                                std::optional<std::size_t> values);

/// The unit (s) of a column of stamps, from how far it went in `seconds`: 1, 1e-3 or 1e-6; empty when it is
/// no clock. For bytes that came at once, as from a file: milliseconds where all are whole, else seconds.
std::optional<double> unit_of_clock(std::span<const double> stamps, double seconds);

}  // namespace supertac
