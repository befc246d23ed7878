// Tables of a sensor's frames as recordings.
#pragma once

#include <string>
#include <vector>

#include "data/recordings/recording.h"
#include "data/recordings/table.h"

namespace supertac {

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
/// stamp, of a clock that is coarser than the frames, are spread over the time to the next. Throws FileError
/// that names the column and what speaks against it: missing; as time, falling or of another rate than the
/// sensor's; as a taxel, no finite number, or outside of the sensor's range for most of the time; too many or
/// too few of them.
Recording recording_of_table(const std::string& path, const Table& table, const ColumnMap& map,
                             const Sensor& sensor);

/// Gives positions from a log of its own, columns time (of the same clock and unit), x and y in mm: by these
/// names, or 0, 1 and 2. Between its rows they are interpolated, before and after it unknown. Throws
/// FileError.
void add_positions(Recording& recording, const std::string& path, const Table& log, double time_unit_s);

/// Takes a table with as many rows as the recording has frames, each an image of `shape`, for the truth;
/// `low` to `high` become 0 to 1. Throws FileError.
void add_truth(Recording& recording, const std::string& path, const Table& images, double low, double high);

}  // namespace supertac
