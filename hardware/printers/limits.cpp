#include "hardware/printers/limits.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "hardware/ports/errors.h"
#include "io/numbers/numbers.h"

namespace supertac::limits {
namespace {

constexpr double kPlateLowX = 97, kPlateHighX = 138.5;
constexpr double kPlateLowY = 99, kPlateHighY = 211.5;

void check_axis(char axis, double value, double low, double high) {
  if (std::isfinite(value) && value >= low && value <= high) return;
  const std::string found = std::isfinite(value) ? format(value, 2) : "no number";
  throw OutsideLimits(std::string("limits: ") + axis + " expected " + format(low, 2) + " to " +
                      format(high, 2) + " mm, found " + found +
                      "; nothing was sent, correct the plan or the limits");
}

}  // namespace

void check_target(const Point3& target) { check_path(target, target); }

void check_path(const Point3& from, const Point3& to) {
  for (const Point3& end : {from, to}) {
    check_axis('X', end.x, kLow.x, kHigh.x);
    check_axis('Y', end.y, kLow.y, kHigh.y);
    check_axis('Z', end.z, kLow.z, kHigh.z);
  }
  if (std::min(from.z, to.z) >= kClearanceZ) return;
  // The part of the line below the clearance is a line itself, and the plate a rectangle: its ends decide.
  double first = 0, last = 1;
  if (from.z != to.z) {
    const double crossing = (kClearanceZ - from.z) / (to.z - from.z);
    if (from.z > kClearanceZ) first = crossing;
    if (to.z > kClearanceZ) last = crossing;
  }
  for (const Point3& end : {between(from, to, first), between(from, to, last)}) {
    const bool over_plate =
        end.x >= kPlateLowX && end.x <= kPlateHighX && end.y >= kPlateLowY && end.y <= kPlateHighY;
    if (!over_plate) {
      throw OutsideLimits("limits: the way from " + describe(from) + " to " + describe(to) + " passes " +
                          describe(end) + ", below Z" + format(kClearanceZ, 2) +
                          " and beside the plate; nothing was sent, lift first");
    }
  }
}

}  // namespace supertac::limits
