// Where the head may go. Marlin ignores its soft limits until homed and clamps silently afterwards, so the
// limits are the host's: every target and the whole way to it is checked before anything is sent.
#pragma once

#include "hardware/printers/marlin_line.h"

namespace supertac {

/// A box; and below clearance_z() only over the plate, so that the finger never runs into the plate's side.
/// By default the rig's.
struct Limits {
  Point3 low{0, 0, 0}, high = rig::kBed;
  Point3 plate = rig::kPlate;  ///< its corner of least x and y, at the slide's height

  /// Lowest z (mm) that is free everywhere: 3.19 above the slide.
  double clearance_z() const;
  /// Throws OutsideLimits naming the axis, the value and the limit.
  void check_target(const Point3& target) const;
  /// Checks both ends and the straight line between them.
  void check_path(const Point3& from, const Point3& to) const;
  bool operator==(const Limits&) const = default;
};

}  // namespace supertac
