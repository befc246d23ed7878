// Where the frames come from: a board, the raw capture of one, or a recording. Board and capture go through
// the same driver.
#pragma once

#include <cmath>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "data/recordings/recording.h"
#include "hardware/boards/tactile_board.h"

namespace supertac {

struct SensorFrame {
  double time_s = 0;             ///< of the sensor, from any zero
  std::span<const float> volts;  ///< valid until the next call
  double arrived_s = 0;          ///< on this computer's clock (monotonic_seconds)
  float x_mm = NAN, y_mm = NAN;  ///< of the finger's centre on the plate, where known
};

class SensorSource {
 public:
  virtual ~SensorSource() = default;
  /// The next frame; nothing when none came within `wait_s`, or ended(). Throws what went wrong with a board
  /// (hardware/ports/errors.h) after the frames before it.
  virtual std::optional<SensorFrame> next(double wait_s) = 0;
  virtual bool ended() const = 0;
  virtual BoardCounters counters() = 0;
  /// Stops reading and completes the capture. Throws JournalError.
  virtual void finish() = 0;

  double period_s() const { return period_s_; }  ///< between two frames
  double filter_s() const { return filter_s_; }  ///< moving average the frames have gone through already
  const TaxelArray& array() const { return array_; }
  /// It waits for nobody: when frames are not taken in time they are lost.
  bool live() const { return live_; }

 protected:
  SensorSource(double period_s, double filter_s, bool live, const TaxelArray& array = {})
      : period_s_(period_s), filter_s_(filter_s), live_(live), array_(array) {}

 private:
  double period_s_, filter_s_;
  bool live_;
  TaxelArray array_;
};

/// The board at `port` ("auto" finds it). With `capture` every byte also goes to a journal of that path.
std::unique_ptr<SensorSource> open_board(const std::string& port, double speedup, const std::string& capture);
/// The board's part of a journal, as fast as it is taken.
std::unique_ptr<SensorSource> open_replay(const std::string& journal);
/// A recording's frames. Throws FileError also when it has fewer than two.
std::unique_ptr<SensorSource> open_recording(const std::string& path);

}  // namespace supertac
