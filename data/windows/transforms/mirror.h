#pragma once

#include <cstdint>
#include <span>

namespace supertac {

/// Which way round an array is looked at.
struct Mirroring {
  bool along_x = false, along_y = false;  ///< columns, rows in reverse order
  /// One of the four, each equally likely; a pure function of both numbers.
  static Mirroring drawn(std::uint64_t seed, std::uint64_t sample);
};

/// Mirrors frames [n][rows][columns] of one number a place, in place: those of a window, or a picture. Throws
/// std::invalid_argument when `frames` is no whole number of frames.
void mirror(const Mirroring& mirroring, std::span<float> frames, std::size_t rows, std::size_t columns);

}  // namespace supertac
