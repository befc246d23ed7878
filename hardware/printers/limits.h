// Where the head may go. Marlin ignores its soft limits until homed and clamps silently afterwards, so the
// limits are the host's: every target and the whole way to it is checked before anything is sent.
#pragma once

#include "hardware/printers/marlin_line.h"

/// A box; and below kClearanceZ only over the plate, so that the finger never runs into the plate's side.
namespace supertac::limits {

constexpr Point3 kLow{0, 0, 0}, kHigh = rig::kBed;
constexpr double kClearanceZ = 95;  ///< lowest z (mm) that is free everywhere

/// Throws OutsideLimits naming the axis, the value and the limit.
void check_target(const Point3& target);
/// Checks both ends and the straight line between them.
void check_path(const Point3& from, const Point3& to);

}  // namespace supertac::limits
