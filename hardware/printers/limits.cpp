#include "hardware/printers/limits.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "hardware/ports/errors.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

// How far from the plate's corner the head is still over the plate, and above the slide free of it.
constexpr double kBeforeX = 2.2, kBehindX = 39.3, kBeforeY = 2.17, kBehindY = 110.33, kClearance = 3.19;

void check_axis(char axis, double value, double low, double high) {
  if (std::isfinite(value) && value >= low && value <= high) return;
  const std::string found = std::isfinite(value) ? format(value, 2) : "no number";
  throw OutsideLimits(std::string("limits: ") + axis + " expected " + format(low, 2) + " to " +
                      format(high, 2) + " mm, found " + found +
                      "; nothing was sent, correct the plan or the limits");
}

}  // namespace

double Limits::clearance_z() const { return plate.z + kClearance; }

void Limits::check_target(const Point3& target) const { check_path(target, target); }

void Limits::check_path(const Point3& from, const Point3& to) const {
  for (const Point3& end : {from, to}) {
    check_axis('X', end.x, low.x, high.x);
    check_axis('Y', end.y, low.y, high.y);
    check_axis('Z', end.z, low.z, high.z);
  }
  const double clearance = clearance_z();
  if (std::min(from.z, to.z) >= clearance) return;
  // The part of the line below the clearance is a line itself, and the plate a rectangle: its ends decide.
  double first = 0, last = 1;
  if (from.z != to.z) {
    const double crossing = (clearance - from.z) / (to.z - from.z);
    if (from.z > clearance) first = crossing;
    if (to.z > clearance) last = crossing;
  }
  for (const Point3& end : {between(from, to, first), between(from, to, last)}) {
    const bool over_plate = end.x >= plate.x - kBeforeX && end.x <= plate.x + kBehindX &&
                            end.y >= plate.y - kBeforeY && end.y <= plate.y + kBehindY;
    if (!over_plate) {
      throw OutsideLimits("limits: the way from " + describe(from) + " to " + describe(to) + " passes " +
                          describe(end) + ", below Z" + format(clearance, 2) +
                          " and beside the plate; nothing was sent, lift first");
    }
  }
}

}  // namespace supertac
