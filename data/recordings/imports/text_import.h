#pragma once

#include <cstddef>
#include <string>

#include "data/recordings/recording.h"

namespace supertac {

/// What was found in a text recording.
struct ImportReport {
  std::size_t lines = 0, empty = 0;  ///< of the file; blank ones
  std::size_t frames = 0;            ///< lines kept
  /// Lines with fewer or more than 16 columns (cut by another, glued together), or one that is no number from
  /// 0 to rig::kAdcVolts.
  std::size_t dropped() const { return lines - empty - frames; }
};

/// Reads a text recording: one frame per line, 16 columns of volts, taxel 0 to 15, separated by spaces, tabs
/// or commas. Lines that are not such a frame are dropped and counted, never repaired: a short line and the
/// rest of it on another cannot be told from halves of different frames.
///
/// The files have no time stamps. Frame i, counted over *all* non-blank lines so that a dropped line leaves a
/// gap, gets i / rig::kFrameRateHz; metadata "time_base" is "nominal" until a registration replaces it. What
/// the host lost without leaving a line - 5 to 20 % of the frames - is for restore_clock
/// (data/registration/pass_features.h). Positions are unknown. plate, trial, pass are left for the caller;
/// source is "imported". Throws FileError when the file cannot be read, is empty or over 64 MiB, or more than
/// a tenth of its lines are not frames: then it is another kind of file. `report` is filled even then.
Recording import_text_pass(const std::string& path, ImportReport& report);

}  // namespace supertac
