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
  std::optional<Sensor> draft;    ///< reads the same frames; nothing where none were found
};

/// `array`: what the array is, where it is known; else the most nearly square one is assumed, and said. A
/// format is taken when at least nine in ten bytes are frames of it.
ProbeReport probe(std::span<const Heard> heard, const std::string& port,
                  const std::optional<TaxelArray>& array);

/// The binary format of `bytes`, which were heard for `seconds`: header (what stays the same from period to
/// period), time stamp, type, byte order, checksum; and how many values a frame has. Nothing where the bytes
/// have no period.
struct BinaryFinding {
  FrameFormat format;
  std::size_t values = 0;
};
std::optional<BinaryFinding> find_binary_format(const std::string& bytes, double seconds,
                                                std::optional<std::size_t> values);

/// What unit a column of stamps counts in, from how far it went in `seconds`: 1, 1e-3 or 1e-6; nothing when
/// it is no clock. Of what came at once, as a file does: milliseconds where all are whole, else seconds.
std::optional<double> unit_of_clock(std::span<const double> stamps, double seconds);

}  // namespace supertac
