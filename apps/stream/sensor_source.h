// Where the frames come from: a sensor, the raw capture of the rig's board, or a recording.
#pragma once

#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "data/recordings/recording.h"
#include "hardware/boards/sensor_reader.h"
#include "hardware/ports/port.h"

namespace supertac {

struct SensorFrame {
  double time_s = 0;               ///< of the sensor, from any zero
  std::span<const float> signals;  ///< in the unit of signal_scale(); valid until the next call
  double arrived_s = 0;            ///< on this computer's clock (monotonic_seconds)
  double wall_s = NAN;           ///< of what is not live: when it arrived (s since 1970), where that is known
  float x_mm = NAN, y_mm = NAN;  ///< of the finger's centre on the plate, where known
  float lift_mm = 0;             ///< how far it is above its slide
  std::optional<FrameArrival> arrival = {};  ///< of a board's frame: what a recording is dated by
};

class SensorSource {
 public:
  virtual ~SensorSource() = default;
  /// The next frame; nothing when none came within `wait_s`, or ended(). Throws what went wrong with a board
  /// (hardware/ports/errors.h) after the frames before it.
  virtual std::optional<SensorFrame> next(double wait_s) = 0;
  virtual bool ended() const = 0;
  virtual ReaderCounters counters() = 0;
  /// Stops reading and completes the capture. Throws JournalError.
  virtual void finish() = 0;

  double period_s() const { return period_s_; }  ///< between two frames
  double filter_s() const { return filter_s_; }  ///< moving average the frames have gone through already
  /// What sends the frames, as far as it is known: of a recording its array, scale and body.
  const Sensor& sensor() const { return sensor_; }
  const TaxelArray& array() const { return sensor_.array; }
  const SignalScale& signal_scale() const { return sensor_.scale; }
  /// Taxels that say nothing: their signals are made of those around them.
  std::vector<int> silent() const { return sensor_.silent(); }
  /// It waits for nobody: when frames are not taken in time they are lost.
  bool live() const { return live_; }

 protected:
  SensorSource(double period_s, double filter_s, bool live, Sensor sensor = {})
      : period_s_(period_s), filter_s_(filter_s), live_(live), sensor_(std::move(sensor)) {}

 private:
  double period_s_, filter_s_;
  bool live_;
  Sensor sensor_;
};

/// Any sensor at its port. With `capture` every byte also goes to a journal of that path. Throws as
/// open_port(), and JournalError.
std::unique_ptr<SensorSource> open_sensor(const Sensor& sensor, double speedup,
                                          const std::string& capture = "");

/// The sensor's part of a journal, as fast as it is taken.
std::unique_ptr<SensorSource> open_replay(const std::string& path,
                                          const std::function<void(const std::string&)>& note);
/// A recording's frames. Throws FileError also when it has fewer than two.
std::unique_ptr<SensorSource> open_recording(const std::string& path);

}  // namespace supertac
