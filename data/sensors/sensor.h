// A sensor is a file: what its array is, what its numbers mean, and how its frames arrive.
#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "data/sensors/taxel_array.h"
#include "io/files/file.h"

namespace supertac {

class JsonObject;

/// What a signal says: (rest - signal) / span is 0 where nothing touches and 1 where a taxel is pressed hard.
/// As JSON {"unit": "counts", "pressed": "higher", "range": [40, 900]}; the default is the rig's.
struct SignalScale {
  std::string unit = "V";
  double rest = 2.45;
  double span = 0.36;  ///< below 0 when pressing raises the signal

  bool rises() const { return span < 0; }
  double low() const { return rises() ? rest : rest - span; }
  double high() const { return rises() ? rest - span : rest; }
  /// The signal of a sensor of scale `other` that means the same load.
  double in(const SignalScale& other, double signal) const {
    return other.rest - other.span * ((rest - signal) / span);
  }
  bool operator==(const SignalScale&) const = default;
};

/// "s", "ms", "us" or "ns" in seconds. Throws std::invalid_argument.
double unit_of_time(const std::string& name);

/// The time stamp in a frame.
struct FrameTime {
  int column = 0;         ///< of a line of text
  std::string key = {};   ///< of a JSON object
  std::string type = {};  ///< of a binary frame, where it follows the header: "u16", "u32", "u64", "f64"
  double unit_s = 1;      ///< "s", "ms", "us" or "ns"
  bool operator==(const FrameTime&) const = default;
};

enum class FrameKind { board, text, json, binary };

/// A part of a binary frame between header and checksum.
struct FrameField {
  enum class Is { values, time, counter, skip };
  Is is = Is::values;
  std::size_t count = 0;  ///< of values; of bytes to skip
  std::string type = {};  ///< of a counter: "u8", "u16" or "u32"
  bool operator==(const FrameField&) const = default;
};

/// Checksums of all bytes from FrameFormat::checksum_from to its own: sums of bytes, their exclusive or, CRCs
/// (8: polynomial 0x07 from 0; 16: as Modbus, or 0x1021 from 0xFFFF, CCITT-FALSE, or from 0; 32: Ethernet's).
inline constexpr const char* kChecksums[] = {"none",         "sum8",        "xor8",         "sum16", "crc8",
                                             "crc16-modbus", "crc16-ccitt", "crc16-xmodem", "crc32"};

/// How a frame is written. Its values stand in the order that Sensor::order names.
struct FrameFormat {
  FrameKind kind = FrameKind::board;
  std::optional<FrameTime> time = {};
  // text: lines_per_frame lines a frame
  char separator = ',';  ///< ' ': any white space; 0 ("any"): every number is a column, whatever is between
  char decimal = '.';    ///< or ','
  int lines_per_frame = 1;     ///< columns count through them
  std::string prefix = {};     ///< a frame's first line begins so; empty: after an empty line, or any line
  std::vector<int> skip = {};  ///< columns that are neither time nor values; of json: places in the array
  // json: a line a frame
  std::string values = {};  ///< key of the array, which may be nested; empty: the line is the array
  // binary: header, fields, checksum, trailer
  std::string header = {}, trailer = {};  ///< bytes
  bool big_endian = false;
  std::string type = "u16";             ///< "u8", "i8", "u16", "i16", "u32", "i32" or "f32"
  std::vector<FrameField> fields = {};  ///< empty: time, where there is one, and all values
  /// Text has it in hexadecimal at the line's end, for what stands before it; "hex" is one that is unknown.
  std::string checksum = "none";  ///< one of kChecksums
  std::optional<std::size_t> checksum_from =
      {};  ///< the frame's first byte that it covers; else behind header
  std::optional<bool> checksum_big_endian = {};  ///< else as big_endian
  bool operator==(const FrameFormat&) const = default;
};

enum class BodyShape { flat, dome, cylinder };

/// A body; by default flat, under a skin that nobody has measured. Loads are shares: 1 presses a taxel hard.
struct Body {
  BodyShape shape = BodyShape::flat;
  double radius_mm = 0;  ///< of a dome, or of a cylinder whose axis lies along the columns
  /// Of the elastic cover. A point that presses it is felt as a bell of standard deviation skin_mm / 2, as
  /// wide at half its height as the pressure under an elastic half-space (Boussinesq). 0: not known.
  double skin_mm = 0;
  double taxel_mm = 0;  ///< side of the square that a taxel is the mean over; 0: a point
  /// A load l shows as l (1 + k) / (l + k): half of what it can show at most at l = k, as a resistor that is
  /// pressed shows in a voltage divider. 0: as l, a linear response.
  double knee = 0;
  /// Of a passive matrix: the share of the mean of its row (of its column) that a taxel shows besides.
  double crosstalk_rows = 0, crosstalk_columns = 0;
  double hysteresis_s = 0;  ///< what is let go comes back with this time constant; what is pressed, at once
  double creep = 0, creep_s = 0;  ///< a load that stays grows by the share `creep` with this time constant
  double noise = 0;               ///< standard deviation of a signal at rest, as a share of the range
  /// Standard deviation of what was found by a fit, by its key: simulations vary it so far.
  std::map<std::string, double> uncertainty = {};

  /// The rig's finger: a dome of 47 mm, whose skin was fitted with its taxels in it (docs/import.md).
  static Body of_rig();
  /// That of a recording or sensor which does not say it: the rig's for its array, else flat.
  static Body usual(const TaxelArray& array);
  /// How far the surface lies behind its foremost point, (x, y) from the array's centre (mm).
  double depth_mm(double x_mm, double y_mm) const;
  /// Standard deviation in mm of the bell under a point that presses: skin and taxel.
  double sigma_mm() const;
  /// Throws std::invalid_argument where a member is out of its range, with its key in the file.
  void check() const;
  bool operator==(const Body&) const = default;
};

/// The numbers of a body that a fit finds, by their keys.
struct BodyNumber {
  const char* key;
  double Body::*of;
};
std::span<const BodyNumber> fitted_numbers();

/// From the loads of an array, a frame after the other, to what its signals show: hysteresis, creep, response
/// and crosstalk, in this order. Of axes that pull either way the response is odd.
class BodyResponse {
 public:
  BodyResponse(const Body& body, const TaxelArray& array);
  /// Whether it changes anything.
  bool neutral() const;
  /// `shares` [taxels,channels] in place, `period_s` after the frame before; the first is taken to have
  /// stood.
  void operator()(double period_s, std::span<double> shares);

 private:
  Body body_;
  TaxelArray array_;
  std::vector<double> load_, crept_;
};

/// A sensor; by default the rig.
struct Sensor {
  std::string name = "rig";
  TaxelArray array = {};
  SignalScale scale = {};
  Body body = Body::of_rig();
  double rate_hz = rig::kFrameRateHz;
  std::string port = "serial:auto@7372800";  ///< as open_port() takes it (hardware/ports/port.h)
  FrameFormat frame = {};
  std::vector<int> order =
      {};                      ///< taxel k is the order[k]-th of a frame, -1: a place without taxel; empty: k
  std::vector<int> dead = {};  ///< taxels that say nothing
  std::vector<float> rest = {};  ///< of each signal where nothing touches; empty: scale.rest of all
  std::vector<float> gain = {};  ///< of each signal: what it is multiplied with from rest on; empty: 1 of all
  double follow_rest_s = 0;      ///< time constant of RestTracker (data/sensors/rest_tracker.h); 0: none

  /// Values in a frame: fewer than array.signals() where the array has places without taxel.
  std::size_t values() const;
  /// dead, and the places without taxel.
  std::vector<int> silent() const;
  /// From the values of a frame to [rows][columns][channels]: signal = scale.rest + (sent - rest) gain, then
  /// fill_silent(). `sent` has values() numbers, `signals` array.signals().
  void arrange(std::span<const float> sent, std::span<float> signals) const;
  /// A silent taxel gets the mean of the others around it, of all when there is none.
  void fill_silent(std::span<float> signals) const;
  /// Takes another order; rest, gain and dead follow their taxels. Throws std::invalid_argument where they
  /// name none for a place in the frame.
  void reorder(std::vector<int> other);
  /// Throws std::invalid_argument where a member is out of its range, with its key in the file.
  void check() const;
  bool operator==(const Sensor&) const = default;
};

/// "rig", or the path of a sensor's file. Throws FileError that names the key, what was expected and found.
Sensor read_sensor(const std::string& name_or_path);
/// The same from text; `where` names it in messages.
Sensor sensor_of_json(const std::string& text, const std::string& where);
nlohmann::ordered_json json_of(const Sensor& sensor);
/// Throws std::invalid_argument as check(), FileError.
void write_sensor(const OutputPath& output, const Sensor& sensor);

/// For a recording's or model's metadata.
nlohmann::ordered_json json_of(const SignalScale& scale);
nlohmann::ordered_json json_of(const Body& body);
/// A number, or [x, y] where they differ.
nlohmann::ordered_json json_of(const Pitch& pitch);
/// That of the key pitch_mm. These throw FileError as sensor_of_json().
Pitch pitch_of(JsonObject& keys, std::optional<Pitch> fallback = {});
SignalScale scale_of(JsonObject keys);
Body body_of(JsonObject keys);

/// What a whole frame says of a touch.
struct FrameLoad {
  /// Sum over the taxels of share = (rest - signal) / span, 1 for a taxel at the end of its range; of several
  /// channels sqrt(sum of share^2), which has no sign. A force in no unit: how hard a share presses differs
  /// from array to array, and a taxel at its end hides what is beyond.
  double total_force = 0;
  std::size_t saturated = 0;  ///< signals with |share| >= 1
};

/// Of a frame [taxels][channels], in the unit of `scale`.
FrameLoad load_of(std::span<const float> signals, int channels, const SignalScale& scale);

/// A frame's header or trailer as a file states it: two hexadecimal digits for each byte.
std::string hex_of_bytes(const std::string& bytes);

}  // namespace supertac
