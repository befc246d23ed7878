// What other programs wrote, as recordings: the rig's text files, tables of a sensor's frames, films of what
// pressed it, and pairs of images.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "data/recordings/recording.h"

namespace supertac {

// --- Tables, the rig's text files, and pairs of images.

/// Numbers in rows and columns, as other programs write them.
struct Table {
  std::vector<std::string> names;   ///< of the columns; empty where the file names none
  std::vector<std::size_t> shape;   ///< of a row: {columns}, or of an array's {height, width, ...}
  std::size_t columns = 0;          ///< numbers in a row
  std::vector<double> values;       ///< row after row
  std::vector<std::size_t> lines;   ///< of a text: the line that each row stands in, from 1
  std::vector<std::size_t> places;  ///< of a text: the same, remarks and empty lines not counted
  std::size_t dropped = 0;          ///< lines of a text that have other columns, or no numbers

  std::size_t rows() const { return columns == 0 ? 0 : values.size() / columns; }
  std::span<const double> row(std::size_t i) const { return {values.data() + i * columns, columns}; }
  /// A column by its name or its number, from 0. Throws std::invalid_argument that lists what there is.
  std::size_t column(const std::string& name) const;
};

/// Reads FILE.npy (NumPy's format 1 to 3: little endian, C order, integers and floats; the first axis counts
/// the rows) or text: a row a line, separated by commas, semicolons, tabs or blanks, '#' before a remark,
/// names in the first line where that holds no number. Lines that are not as long as most, or hold what is no
/// number, are dropped and counted. Throws FileError: more than 4 GiB, another format, more than a tenth of
/// the lines dropped, no row.
Table read_table(const std::string& path);

/// A recording of the rig as its authors published it: lines of 16 voltages, taxel 0 to 15, in any form of
/// text that read_table() knows. Lines that are no 16 numbers from 0 to rig::kAdcVolts are dropped and
/// counted, never repaired: a short line and the rest of it on another cannot be told from halves of
/// different frames.
///
/// The files have no time stamps. Frame i, counted over *all* lines that are not empty, so that a dropped one
/// leaves a gap, gets i / rig::kFrameRateHz; metadata "time_base" is "nominal" until a registration replaces
/// it. What the host lost without leaving a line - 5 to 20 % of the frames - is for restore_clock
/// (data/registration/registration.h). Positions are unknown. plate, trial, pass are left for the caller;
/// source is "imported". Throws FileError as read_table(), for other columns, and where more than a tenth of
/// the lines are dropped.
Recording import_text_pass(const std::string& path, std::size_t& dropped);

/// Which columns of a table hold what, each by its name or its number from 0.
struct ColumnMap {
  std::string time;        ///< empty: row i is at i / Sensor::rate_hz
  double time_unit_s = 1;  ///< 1e-3: milliseconds
  std::string x, y;        ///< mm on the plate; empty: not known
  /// "8-71", "s0-s63" or single columns: the values of a frame. Empty: all columns that are not named
  /// otherwise, in their order.
  std::vector<std::string> values;
};

/// From "time=t_ms:ms,x=px,y=py,values=8-71"; values may be named several times. Throws
/// std::invalid_argument.
ColumnMap column_map(const std::string& text);

/// The frames of a table, as the sensor would have sent them (Sensor::arrange). Rows with the same time
/// stamp, of a clock that is coarser than the frames, are spread over the time to the next; a counter of 16
/// or 32 bits may run over. Times from 1e9 s on are since 1970, and stay so (Recording::began_s() is 0).
/// Throws FileError that names the column and what speaks against it: missing; as time, falling or of another
/// rate than the sensor's; as a taxel, no finite number, or outside of the sensor's range for most of the
/// time; too many or too few of them.
Recording recording_of_table(const std::string& path, const Table& table, const ColumnMap& map,
                             const Sensor& sensor);

/// Sets the positions from a separate log, columns time (of the same clock and unit), x and y in mm: by these
/// names, or 0, 1 and 2. Between its rows they are interpolated, before and after it unknown. Throws
/// FileError.
void add_positions(Recording& recording, const std::string& path, const Table& log, double time_unit_s);

/// Takes a table with as many rows as the recording has frames, each an image of `shape`, for the truth;
/// `low` to `high` become 0 to 1. Throws FileError.
void add_truth(Recording& recording, const std::string& path, const Table& images, double low, double high);

/// Recordings with measured truth from pairs of a low- and a high-resolution image, a safetensors file with
///   input   F32 [N,C,H,W]    what the sensor gave: N frames of H x W taxels, C channels
///   target  F32 [N,1,sH,sW]  what a finer sensor saw of each, in [0,1]; s is 2, 4, 8 or 16
///   group   I64 [N]          optional: frames of one person, object or day belong together
/// Each group becomes a recording, whose plate and metadata "group" are the group's number with as many
/// digits as the longest; without groups there is one, and its plate is "pairs". The times of the frames are
/// unknown: they are set one second apart, and there is no trial. `sensor` says what the numbers mean;
/// without it pressing raises them, from the lowest value of the file to the highest, and taxels are 1 mm
/// apart. Throws FileError naming the tensor, what was expected and found; also where the targets of a group
/// show touches at other frames than its inputs do.
std::vector<Recording> import_pairs(const SafetensorsFile& file, const std::optional<Sensor>& sensor = {});

// --- A film of the truth that has a clock of its own, and how the two clocks are found to agree.

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
/// uncertain by more than 4 ms or 0.04 %.
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
