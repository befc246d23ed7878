// Two clocks: when a film of the truth shows what a sensor felt.
#pragma once

#include <span>
#include <string>
#include <vector>

namespace supertac {

/// sensor time = offset_s + rate * film time, with standard deviations; offset_s at the film's middle is
/// known best, so its deviation is that of the time there.
struct FilmClock {
  double offset_s = 0, rate = 1;
  double offset_deviation_s = 0, rate_deviation = 0;
  double correlation = 0;  ///< of the two total loads, once they are laid onto each other
  double sensor_s(double film_s) const { return offset_s + rate * film_s; }
  /// "0.613 +- 0.002 s late, 1.0004 +- 0.0001 times as fast"
  std::string text() const;
};

/// A course of the total load, as its own clock dates it; the times increase.
struct LoadCourse {
  std::span<const double> time_s, load;
};

/// Finds the clock from the loads alone. Both are cut at their 2nd and 98th percentile and scaled to 0 to 1,
/// so that saturation and outliers matter little. Every offset up to kFarthestS from the same beginning (or,
/// where the clocks overlap already, from none) and every rate within kMostRate of 1 is tried on steps of 50
/// ms; the best is refined by Gauss-Newton steps with the load's own slope, pixels of time weighted by a
/// Huber norm of three deviations. The deviations of shift and rate are a jackknife's over seconds of the
/// film. Throws std::runtime_error, saying why, where the courses do not agree: fewer than three touches, or
/// less in common than kFarthestS, correlation below 0.8, another place nearly as good, or a time that stays
/// uncertain by more than 4 ms or .04 %.
FilmClock find_film_clock(const LoadCourse& sensor, const LoadCourse& film);
constexpr double kFarthestS = 5, kMostRate = 0.025;

}  // namespace supertac
