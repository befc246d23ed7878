#pragma once

#include <span>

#include "data/recordings/recording.h"
#include "data/registration/registration.h"

namespace supertac {

/// A pass and where its own registration puts it.
struct RegisteredPass {
  const Recording* recording = nullptr;
  Registration* registration = nullptr;
};

/// Aligns the passes of one plate with each other. A registration knows its pass by a few dozen contacts; the
/// whole course of the signals, beside that of the other passes over the same texture, tells its place
/// better.
///
/// Each pass is a profile p_r(y): how far the four taxels of row r are pressed on average within 1 mm of y,
/// for y = 22..92 mm. Its line is changed by a shift a and a stretch b (mm),
///   y' = y + a + b (y - 54) / 26,
/// for the largest
///   mean over r of corr(p_r, mean of the other passes' p_r) - 0.002 ((a / 0.5)^2 + b^2),
/// six rounds over all passes. The medians of a and b over the passes are subtracted in each round, so that
/// the plate as a whole stays where the registrations put it.
///
/// A pass that agrees badly (correlation below 0.9) is tried with frames lost at one place: 0.1 to 0.8 s, at
/// every 0.2 s. Where the signals stand still such a loss leaves no step for find_lost_frames() to see. It is
/// accepted when the correlation rises by 0.05, and all passes are aligned once more.
///
/// Passes that are not reliable take no part; with fewer than three nothing changes, nor does a pass whose
/// correlation stays below a half. Sets start_mm, rate, shift_mm, stretch_mm, lost_at_s, lost_s and agreement
/// (the correlation). It uses no truth, split or network. Throws std::invalid_argument when a recording is
/// not of the rig's array.
void align_passes(std::span<const RegisteredPass> passes);

}  // namespace supertac
