// Tables of a sensor's frames, and pairs of images, as recordings.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "data/recordings/recording.h"

namespace supertac {

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
///   group   I64 or I32 [N]   optional: frames of one person, object or day belong together
/// Each group becomes a recording, whose plate and metadata "group" are the group's number with as many
/// digits as the longest; without groups there is one, and its plate is "pairs". The times of the frames are
/// unknown: they are set one second apart, and there is no trial. `sensor` says what the numbers mean;
/// without it pressing raises them, from the lowest value of the file to the highest, and taxels are 1 mm
/// apart. Throws FileError naming the tensor, what was expected and found; also where the targets of a group
/// show touches at other frames than its inputs do.
std::vector<Recording> import_pairs(const SafetensorsFile& file, const std::optional<Sensor>& sensor = {});

}  // namespace supertac
