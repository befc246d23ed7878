// A film of the truth that has a clock of its own, and how the two clocks are found to agree.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "data/recordings/imports/table_import.h"
#include "data/recordings/recording.h"

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

/// Takes the time, column "time" or else the first, out of a text table whose rows are that and the pixels of
/// an image 2, 4, 8 or 16 times as fine as the array, row after row; the table then is of images. Throws
/// FileError.
std::vector<double> take_film_times(const std::string& path, Table& film, const TaxelArray& array);
/// The times of `images` from a table of their own: its column "time", or its only one. Throws FileError.
std::vector<double> film_times(const std::string& path, const Table& times, const Table& images);

/// Sets the truth from images that were taken at `film_s` (s, ascending) by another clock than the sensor's:
/// finds that clock (find_film_clock) from the sum of all loads against the sum of all pixels, takes each
/// frame's truth from the images before and after it, and leaves out frames that the film did not see.
/// Metadata "truth_clock" says what was found. Throws FileError, also where the two do not agree.
FilmClock add_film(Recording& recording, const std::string& path, const Table& images,
                   const std::vector<double>& film_s, double low, double high);

/// Of a truth that has an image for each frame (add_truth): how much later it shows what the signals show,
/// with frames at `time_s`; nothing where that cannot be told.
std::optional<FilmClock> clock_of_truth(const Recording& recording, std::span<const double> time_s);

/// Moves a truth of clock_of_truth() that comes more than 20 ms, and four deviations, late or early, as
/// add_film() would have, and returns its clock; else nothing changes.
std::optional<FilmClock> put_in_time(Recording& recording);

}  // namespace supertac
