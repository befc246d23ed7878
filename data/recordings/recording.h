// A pass of a finger, or presses of an array, as they were recorded; and its file.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "data/sensors/sensor.h"
#include "io/files/safetensors.h"

namespace supertac {

/// Lifted further than this, a finger is in the air: a measured height is never quite that of the slide.
inline constexpr double kLiftedMm = 0.1;

/// One pass of the finger over a plate, at the rate it was recorded with.
struct Recording {
  std::vector<double> time_s;  ///< n, strictly increasing
  std::vector<float> signals;  ///< n x array.signals(), a frame together, in the unit of signal_scale
  std::vector<float>
      position_mm;  ///< n x 2: (x, y) of the finger's centre on the plate; empty, or NaN where unknown
  std::vector<float> lift_mm;  ///< n: how far the finger is above its slide; empty: it slides throughout
  /// n x height x width in [0,1]: what a finer sensor saw of each frame, row 0 and column 0 as the array's;
  /// empty: the truth follows from plate and position (data/plates/truth.h).
  std::vector<float> truth;
  int truth_height = 0, truth_width = 0;
  TaxelArray array;
  SignalScale signal_scale;                     ///< unit, polarity and range of the signals
  std::optional<Body> body;                     ///< of the sensor; not stated: Body::usual(array)
  std::string plate;                            ///< name as Plate::named takes it
  int trial = 0, pass = 0;                      ///< from 1
  double speed_mm_s = 0;                        ///< as measured, or commanded; 0 when unknown
  std::string source;                           ///< "simulated", "imported", "collected" or "streamed"
  std::map<std::string, std::string> metadata;  ///< whatever else is worth keeping (filter, time base, ...)

  std::size_t frames() const { return time_s.size(); }
  /// Between two frames: the median, since lost frames leave gaps; 0 of fewer than two.
  double period_s() const;
  /// Length of the moving average that the signals went through (s); 0 when the metadata names none.
  double filter_s() const;
  /// Wall-clock time of time_s 0 (s since 1970); NaN when the metadata name none ("began_s").
  double began_s() const;
};

/// What breaks a rule of read_recording(), or nothing.
std::optional<std::string> problem_of(const Recording& recording);

/// Converts the signals to another unit, polarity and range.
void restate(Recording& recording, const SignalScale& scale);

/// Reads a safetensors file with tensors time_s F64 [n], signals F32 [n,signals] (volts, where they are
/// volts: signals_tensor()) and, where known, position_mm F32 [n,2], lift_mm F32 [n] and truth F32
/// [n,height,width]. Metadata "array" says how the taxels lie, {"rows": 6, "columns": 6, "pitch_mm": 2,
/// "channels": 1} (pitch_mm may be [x, y]); without it they are the rig's 4x4 taxels at 3 mm. Metadata
/// "signals" says what the numbers mean, {"unit": "counts", "pressed": "higher", "range": [40, 900]}; without
/// it they are the rig's volts. Metadata "body" is that of a sensor's file. Throws FileError when the file is
/// damaged (io/files/safetensors.h), is no recording, or breaks a rule of Recording: sizes that do not match,
/// values that are not finite (position_mm may be NaN), a truth outside [0,1], an unknown tensor, time stamps
/// that do not increase, a speed outside 0 to 1e4 mm/s, a moving average (metadata "filter_s") outside 0 to
/// 10 s, or a time (also metadata "began_s") beyond 1e10 s.
Recording read_recording(const std::string& path);
/// The same from a file that has been read.
Recording recording_of(const SafetensorsFile& file);

/// Writes it atomically; the same recording gives the same bytes.
/// Throws std::invalid_argument when the recording breaks a rule read_recording() checks, or its metadata
/// has a key this function writes (kind, plate, trial, pass, speed_mm_s, source, array, signals, body);
/// FileError when it cannot be written.
void write_recording(const std::string& path, const Recording& recording);

/// The metadata of its file: its own and the members that are no tensor. Throws std::invalid_argument when
/// its own have a key of these.
std::map<std::string, std::string> metadata_of(const Recording& recording);

/// "array" of a file's metadata, the rig's where it has none (throws FileError); and "array" and "signals",
/// which recordings and logs of pictures have.
TaxelArray array_of(const SafetensorsFile& file);
std::map<std::string, std::string> metadata_of(const TaxelArray& array, const SignalScale& scale);

/// The tensor that holds the signals of a recording or a log of pictures: "volts" where they are volts,
/// "signals" of any other unit; until 0.2 "volts" of all, and read so for ever.
inline const char* signals_tensor(const SignalScale& scale) {
  return scale.unit == "V" ? "volts" : "signals";
}
/// Which of the two a file has.
inline const char* signals_tensor(const SafetensorsFile& file) {
  return file.tensors().contains("signals") ? "signals" : "volts";
}

/// "<plate>_t<trial>_p<pass>_v<speed>.safetensors", the name a recording has in a folder of recordings.
std::string recording_file_name(const Recording& recording);

/// Paths of all *.safetensors files in the folder (not below it), sorted by name.
/// Throws FileError when the folder cannot be read or has none.
std::vector<std::string> list_recordings(const std::string& folder);

/// Names the content of a folder's recordings (of these plates; all when empty), independent of windows, file
/// names and provenance: SHA-256 over their sorted content hashes (io/files/safetensors.h). Throws FileError.
std::string hash_of_recordings(const std::string& folder, const std::vector<std::string>& plates);

}  // namespace supertac
