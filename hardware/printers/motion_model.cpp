#include "hardware/printers/printer.h"

#include <algorithm>
#include <cmath>

namespace supertac {

double trapezoid_position(double t, double distance, double duration, double acceleration) {
  if (t <= 0) return 0;
  if (t >= duration) return distance;
  // A duration too short for the acceleration means the model's acceleration is too small: use the triangle.
  const double a = std::max(acceleration, 4 * distance / (duration * duration));
  const double speed =
      0.5 * a * (duration - std::sqrt(std::max(0.0, duration * duration - 4 * distance / a)));
  const double ramp = speed / a;
  if (t < ramp) return 0.5 * a * t * t;
  if (t > duration - ramp) return distance - 0.5 * a * (duration - t) * (duration - t);
  return speed * (t - 0.5 * ramp);
}

double trapezoid_duration(double distance, double speed, double acceleration) {
  if (distance < speed * speed / acceleration) return 2 * std::sqrt(distance / acceleration);
  return distance / speed + speed / acceleration;
}

}  // namespace supertac
