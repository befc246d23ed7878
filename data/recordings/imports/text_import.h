#pragma once

#include <cstddef>
#include <string>

#include "data/recordings/recording.h"

namespace supertac {

/// What was found in a text recording. lines = frames + malformed() + non_finite + out_of_range + empty.
struct ImportReport {
  std::size_t lines = 0;     ///< lines in the file
  std::size_t frames = 0;    ///< lines kept
  std::size_t too_few = 0;   ///< lines with fewer than 16 columns (a line cut by another)
  std::size_t too_many = 0;  ///< lines with more (lines glued together)
  std::size_t not_numeric =
      0;  ///< 16 columns, one of which is no number (two numbers run into one, letters, NUL)
  std::size_t non_finite = 0;    ///< 16 numbers, one of them nan or inf
  std::size_t out_of_range = 0;  ///< 16 numbers, one outside of what the ADC measures
  std::size_t empty = 0;         ///< blank lines

  std::size_t malformed() const { return too_few + too_many + not_numeric; }
};

/// Reads a text recording: one frame per line, 16 columns of volts, taxel 0 to 15, separated by spaces, tabs
/// or commas. Lines that are not such a frame are dropped and counted, never repaired: a short line and the
/// rest of it on another cannot be told from halves of different frames.
///
/// The files have no time stamps. Frame i, counted over *all* non-blank lines so that a dropped line leaves a
/// gap, gets i / rig::kFrameRateHz; metadata "time_base" is "nominal" until a registration replaces it. What
/// the host lost without leaving a line - 5 to 20 % of the frames - is for restore_clock
/// (data/registration/lost_frames.h). Positions are unknown. plate, trial, pass are left for the caller;
/// source is "imported". Throws FileError when the file cannot be read, is empty or over 64 MiB, or more than
/// a tenth of its lines are not frames: then it is another kind of file. `report` is filled even then.
Recording import_text_pass(const std::string& path, ImportReport& report);

}  // namespace supertac
