// One straight move with acceleration: the trapezoid of speed over time.
#pragma once

namespace supertac {

/// Distance covered `t` seconds into a move of `distance` mm that lasts `duration` s: symmetric acceleration
/// `acceleration` (mm/s^2) at both ends, constant speed v between, where v solves
/// distance = v (duration - v / acceleration). Clamped to [0, distance].
double trapezoid_position(double t, double distance, double duration, double acceleration);

/// Duration (s) of a move of `distance` mm whose top speed is at most `speed` (mm/s).
double trapezoid_duration(double distance, double speed, double acceleration);

}  // namespace supertac
