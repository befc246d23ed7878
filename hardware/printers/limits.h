// Where the head may go. Marlin ignores its soft limits until homed and clamps silently afterwards, so the
// limits are the host's: every target and the whole way to it is checked before anything is sent.
#pragma once

#include "hardware/printers/marlin_line.h"

namespace supertac {

/// A box; and below `clearance_z` only over the plate, so that the finger never runs into the plate's side.
struct Limits {
  Point3 low{0, 0, 0};
  Point3 high = rig::kBed;
  double clearance_z = 95;  ///< lowest z (mm) that is free everywhere
  double plate_low_x = 97, plate_high_x = 138.5;
  double plate_low_y = 99, plate_high_y = 211.5;

  /// Throws OutsideLimits naming the axis, the value and the limit.
  void check_target(const Point3& target) const;
  /// Checks both ends and the straight line between them.
  void check_path(const Point3& from, const Point3& to) const;
};

}  // namespace supertac
