// A film of the truth that has a clock of its own.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "data/recordings/imports/film_clock.h"
#include "data/recordings/imports/table.h"
#include "data/recordings/recording.h"

namespace supertac {

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
