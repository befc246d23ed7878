#include "data/recordings/imports/imports.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>

#include "data/recordings/resample.h"
#include "data/sensors/rest_tracker.h"
#include "io/files/file.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

/// The columns that "8-71", "s0-s63" or a single name stand for.
void append_columns(const Table& table, const std::string& text, std::vector<std::size_t>& columns) {
  // A name may hold a '-' of its own.
  for (std::size_t dash = text.find('-'); dash != std::string::npos; dash = text.find('-', dash + 1)) {
    const std::string first = text.substr(0, dash), last = text.substr(dash + 1);
    const auto known = [&](const std::string& name) {
      return std::ranges::find(table.names, name) != table.names.end() || parse_uint(name).has_value();
    };
    if (!known(first) || !known(last)) continue;
    const std::size_t from = table.column(first), to = table.column(last);
    if (to < from) throw std::invalid_argument("values " + in_quotes(text) + " end before they begin");
    for (std::size_t c = from; c <= to; ++c) columns.push_back(c);
    return;
  }
  columns.push_back(table.column(text));
}

struct Columns {
  std::optional<std::size_t> time, x, y;
  std::vector<std::size_t> values;
};

Columns columns_of(const Table& table, const ColumnMap& map, const Sensor& sensor) {
  Columns columns;
  const std::size_t expected = sensor.values();
  const FrameFormat& frame = sensor.frame;
  if (map.time.empty() && map.x.empty() && map.values.empty() && frame.kind == FrameKind::text &&
      table.columns == expected + frame.skip.size() + (frame.time ? 1 : 0)) {
    // The table is what the sensor sends, as its file describes it.
    if (frame.time) columns.time = static_cast<std::size_t>(frame.time->column);
    for (std::size_t c = 0; c < table.columns; ++c)
      if (c != columns.time && std::ranges::find(frame.skip, static_cast<int>(c)) == frame.skip.end())
        columns.values.push_back(c);
    if (columns.values.size() == expected) return columns;
    columns = {};
  }
  const auto find = [&](const std::string& name) {
    return name.empty() ? std::nullopt : std::optional(table.column(name));
  };
  columns.time = find(map.time), columns.x = find(map.x), columns.y = find(map.y);
  for (const std::string& text : map.values) append_columns(table, text, columns.values);
  for (std::size_t c = 0; c < table.columns && map.values.empty(); ++c)
    if (c != columns.time && c != columns.x && c != columns.y) columns.values.push_back(c);
  if (columns.values.size() != expected)
    throw std::invalid_argument(std::to_string(columns.values.size()) + " columns hold values" +
                                (map.values.empty() ? ", all that --columns does not name" : "") +
                                "; a frame of the sensor has " + std::to_string(expected) +
                                ": name them, --columns values=FIRST-LAST, and time=, x=, y=");
  std::set<std::size_t> named(columns.values.begin(), columns.values.end());
  std::size_t count = columns.values.size();
  for (const auto& c : {columns.time, columns.x, columns.y})
    if (c) named.insert(*c), ++count;
  if (named.size() != count)
    throw std::invalid_argument("a column has two meanings: expected one of time, x, y and values for each");
  return columns;
}

/// Refuses images that are no frames of the array; where the taxels have an order of their own, any may be.
void check_shape(const Table& table, const Sensor& sensor) {
  if (table.shape.size() < 2 || !sensor.order.empty()) return;
  const auto side = [](int n) { return static_cast<std::size_t>(n); };
  const std::size_t rows = side(sensor.array.rows), columns = side(sensor.array.columns),
                    channels = side(sensor.array.channels);
  std::vector<std::size_t> found = table.shape;
  std::erase(found, 1U);
  const std::vector<std::size_t> forms[] = {{rows, columns, channels},
                                            {rows * columns, channels},
                                            {rows, columns * channels},
                                            {rows * columns * channels}};
  for (std::vector<std::size_t> form : forms) {
    std::erase(form, 1U);
    if (found == form) return;
  }
  throw std::invalid_argument("holds frames of " + joined(table.shape, "x") + ", the sensor's file says " +
                              sensor.array.text());
}

std::string name_of(const Table& table, std::size_t column) {
  return "column " + std::to_string(column) +
         (table.names.empty() ? "" : " (" + printable(table.names[column]) + ")");
}
std::string place(const Table& table, std::size_t row) {
  return table.lines.empty() ? "row " + std::to_string(row) : "line " + std::to_string(table.lines[row]);
}

/// Equal stamps, of a clock that is coarser than the frames, over the time to the next one.
void spread_equal_stamps(std::vector<double>& time_s, double step) {
  for (std::size_t begin = 0, end = 0; begin < time_s.size(); begin = end) {
    end = begin + 1;
    while (end < time_s.size() && time_s[end] == time_s[begin]) ++end;
    const double count = static_cast<double>(end - begin);
    if (end < time_s.size()) step = (time_s[end] - time_s[begin]) / count;
    for (std::size_t i = begin + 1; i < end; ++i)
      time_s[i] = time_s[begin] + step * static_cast<double>(i - begin);
  }
}

/// What a counter lost of its units that ran over from one row to the next, at most `most` apart; 0 where it
/// did not.
double ran_over(double before, double now, double most) {
  for (const double range : {65536.0, 4294967296.0})
    for (const double lowest : {0.0, -range / 2})  // unsigned, signed
      if (before < lowest + range && now >= lowest && now < before && now + range - before < most)
        return range;
  return 0;
}

std::vector<double> times_of(const std::string& path, const Table& table, std::optional<std::size_t> column,
                             double unit, double rate_hz) {
  // A line that was dropped leaves its time empty.
  const auto number = [&](std::size_t i) {
    return table.places.empty() ? i : table.places[i] - table.places[0];
  };
  std::vector<double> time_s;
  const double most = std::max(1.0, 10 / rate_hz) / unit;
  double over = 0;
  for (std::size_t i = 0; i < table.rows(); ++i) {
    if (column && i > 0) over += ran_over(table.row(i - 1)[*column], table.row(i)[*column], most);
    const double t =
        column ? (table.row(i)[*column] + over) * unit : static_cast<double>(number(i)) / rate_hz;
    if (!std::isfinite(t))
      throw FileError(path, name_of(table, *column) + " as time: no number in " + place(table, i));
    if (i > 0 && t < time_s.back())
      throw FileError(path, name_of(table, *column) + " as time falls in " + place(table, i) + ", from " +
                                format(table.row(i - 1)[*column]) + " to " + format(table.row(i)[*column]) +
                                "; name another column, --columns time=NAME");
    time_s.push_back(t);
  }
  if (!column || time_s.size() < 2) return time_s;
  const double span = time_s.back() - time_s.front();
  spread_equal_stamps(time_s, span > 0 ? span / static_cast<double>(time_s.size() - 1) : 1);
  return time_s;
}

void check_rate(const std::string& path, const Table& table, std::optional<std::size_t> column,
                const Recording& recording, double rate_hz) {
  if (!column || recording.frames() < 2) return;
  const double found = 1 / recording.period_s();
  if (!(found > 0.5 * rate_hz && found < 2 * rate_hz))
    throw FileError(path, name_of(table, *column) + " as time has " + format(found, 1) +
                              " frames/s, the sensor is said to send " + format(rate_hz, 1) +
                              "; is it in s, ms or us (--columns time=NAME:ms)?");
}

/// Refuses a column that says what the sensor cannot say.
void check_taxel(const std::string& path, const Table& table, std::size_t column, std::size_t value,
                 const SignalScale& scale) {
  const std::string which = name_of(table, column) + " as value " + std::to_string(value) + " of the frame ";
  std::vector<float> signals;
  for (std::size_t i = 0; i < table.rows(); ++i) {
    const double v = table.row(i)[column];
    if (!std::isfinite(v) || std::abs(v) > std::numeric_limits<float>::max())
      throw FileError(path,
                      which + "is " + format(v) + " in " + place(table, i) + ", expected a finite number");
    signals.push_back(static_cast<float>(v));
  }
  if (const std::string why = contradiction(signals, scale); !why.empty())
    throw FileError(path, which + "runs " + why + "; name another column, or mend the sensor's file");
}

/// NaN is a position that is not known.
float checked_mm(const std::string& path, const Table& table, std::size_t column, double mm) {
  if (std::isnan(mm) || std::abs(mm) <= 1e5) return static_cast<float>(mm);
  throw FileError(
      path, name_of(table, column) + " as a position holds " + format(mm) + ", expected mm on the plate");
}

}  // namespace

ColumnMap column_map(const std::string& text) {
  ColumnMap map;
  for (const std::string& entry : comma_list(text)) {
    const std::size_t equals = entry.find('=');
    const std::string key = entry.substr(0, equals);
    std::string value = equals == std::string::npos ? "" : entry.substr(equals + 1);
    if (value.empty() || (key != "time" && key != "x" && key != "y" && key != "values"))
      throw std::invalid_argument(
          "found " + in_quotes(entry) +
          ", expected time=COLUMN[:s|ms|us|ns], x=COLUMN, y=COLUMN, values=FIRST-LAST");
    if (const std::size_t colon = value.rfind(':'); key == "time" && colon != std::string::npos) {
      map.time_unit_s = unit_of_time(value.substr(colon + 1));
      value.resize(colon);
    }
    if (key == "values") {
      map.values.push_back(value);
      continue;
    }
    std::string& column = key == "time" ? map.time : key == "x" ? map.x : map.y;
    if (!column.empty()) throw std::invalid_argument("names " + key + " twice");
    column = value;
  }
  if (map.x.empty() != map.y.empty())
    throw std::invalid_argument("names only one of x and y; a position has both");
  return map;
}

Recording recording_of_table(const std::string& path, const Table& table, const ColumnMap& map,
                             const Sensor& sensor) {
  Columns columns;
  try {
    columns = columns_of(table, map, sensor);
    if (map.values.empty()) check_shape(table, sensor);
  } catch (const std::invalid_argument& error) {
    throw FileError(path, error.what());
  }
  Recording recording;
  const double unit = columns.time && map.time.empty() ? sensor.frame.time->unit_s : map.time_unit_s;
  recording.array = sensor.array, recording.signal_scale = sensor.scale;
  recording.body = sensor.body, recording.source = "imported";
  recording.time_s = times_of(path, table, columns.time, unit, sensor.rate_hz);
  check_rate(path, table, columns.time, recording, sensor.rate_hz);
  // No sensor has been on since 2001: such a clock counts from 1970.
  if (!recording.time_s.empty() && recording.time_s.front() >= 1e9) recording.metadata["began_s"] = "0";
  std::vector<bool> silent(columns.values.size());
  for (const int taxel : sensor.dead)
    for (int c = 0; c < sensor.array.channels && sensor.order.empty(); ++c)
      silent[static_cast<std::size_t>(taxel * sensor.array.channels + c)] = true;
  for (std::size_t k = 0; k < columns.values.size(); ++k)
    if (!silent[k]) check_taxel(path, table, columns.values[k], k, sensor.scale);
  const std::size_t signals = sensor.array.signals();
  recording.signals.resize(table.rows() * signals);
  std::vector<float> sent(sensor.values());
  RestTracker rest(sensor);
  for (std::size_t i = 0; i < table.rows(); ++i) {
    for (std::size_t k = 0; k < sent.size(); ++k)
      sent[k] = static_cast<float>(table.row(i)[columns.values[k]]);
    const auto frame = std::span(recording.signals).subspan(i * signals, signals);
    sensor.arrange(sent, frame);
    rest.follow(recording.time_s[i], frame);
    if (!columns.x) continue;
    for (const std::size_t column : {*columns.x, *columns.y})
      recording.position_mm.push_back(checked_mm(path, table, column, table.row(i)[column]));
  }
  return recording;
}

void add_positions(Recording& recording, const std::string& path, const Table& log, double time_unit_s) {
  const bool named = !log.names.empty();
  std::size_t time = 0, x = 1, y = 2;
  try {
    time = log.column(named ? "time" : "0"), x = log.column(named ? "x" : "1"),
    y = log.column(named ? "y" : "2");
  } catch (const std::invalid_argument& error) {
    throw FileError(path, std::string(error.what()) + "; expected time, x and y");
  }
  if (log.rows() < 2) throw FileError(path, "holds one position, expected two or more with their times");
  const std::vector<double> time_s = times_of(path, log, time, time_unit_s, 1);
  recording.position_mm.assign(2 * recording.frames(), std::numeric_limits<float>::quiet_NaN());
  std::size_t known = 0;
  for (std::size_t i = 0; i < recording.frames(); ++i) {
    const double t = recording.time_s[i];
    const auto after = std::ranges::upper_bound(time_s, t);
    if (after == time_s.begin() || (after == time_s.end() && t > time_s.back())) continue;
    const auto before = static_cast<std::size_t>(std::min(after, time_s.end() - 1) - time_s.begin()) - 1;
    const double share = (t - time_s[before]) / (time_s[before + 1] - time_s[before]);
    for (const std::size_t axis : {0U, 1U}) {
      const std::size_t column = axis == 0 ? x : y;
      const double a = log.row(before)[column], b = log.row(before + 1)[column];
      recording.position_mm[2 * i + axis] = checked_mm(path, log, column, a + share * (b - a));
    }
    ++known;
  }
  if (10 * known < recording.frames())
    throw FileError(path, "says where " + std::to_string(known) + " of " +
                              std::to_string(recording.frames()) + " frames were: it has times from " +
                              format(time_s.front(), 3) + " to " + format(time_s.back(), 3) +
                              " s, the frames from " + format(recording.time_s.front(), 3) + " to " +
                              format(recording.time_s.back(), 3) +
                              " s; are both of one clock, in the unit that --columns names?");
}

void add_truth(Recording& recording, const std::string& path, const Table& images, double low, double high) {
  if (images.shape.size() != 2)
    throw FileError(path, "has rows of rank " + std::to_string(images.shape.size()) +
                              ", expected images: an array [frames, height, width] in a .npy file");
  if (images.rows() != recording.frames())
    throw FileError(path, "holds " + std::to_string(images.rows()) + " images, the recording has " +
                              std::to_string(recording.frames()) + " frames; expected one for each");
  recording.truth_height = static_cast<int>(images.shape[0]);
  recording.truth_width = static_cast<int>(images.shape[1]);
  recording.truth.clear();
  for (const double value : images.values) {
    const double scaled = (value - low) / (high - low);
    if (!(scaled >= -1e-6 && scaled <= 1 + 1e-6))
      throw FileError(path, "holds " + format(value) + ", expected " + format(low) + " to " + format(high) +
                                ": say what is 0 and what is 1 with --truth-range LOW,HIGH");
    recording.truth.push_back(static_cast<float>(std::clamp(scaled, 0.0, 1.0)));
  }
}

}  // namespace supertac
