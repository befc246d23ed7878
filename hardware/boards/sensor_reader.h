// Any sensor, live, the rig's board as well: a thread reads, decodes and dates, a bounded queue hands frames
// over. The reader never waits for its consumer (but for what is not live), so a slow consumer loses the
// oldest frames; a counter says how many.
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "data/clock/frame_clock.h"
#include "data/frames/probe.h"
#include "data/frames/sensor_decoder.h"
#include "data/sensors/rest_tracker.h"
#include "hardware/ports/port.h"

namespace supertac {

/// One frame as it is handed over.
struct ReadFrame {
  std::vector<float> signals;  ///< as Sensor::arrange() and RestTracker::follow(), in the sensor's unit
  FrameDate date;              ///< of FrameClock, of the sensor
  FrameArrival arrival;        ///< on the port's clock
  bool suspect = false;  ///< after discarded bytes; the rig's also after a pause of 1.5 periods: may be torn
  bool jump = false;     ///< implausible change of a taxel
};

struct ReaderCounters {
  SensorDecoder::Counters decoder;
  std::uint64_t damaged = 0;  ///< frames with a signal that is no number; not handed over
  std::uint64_t missing = 0;  ///< frames that did not arrive whole, by the clock
  std::uint64_t resets = 0;   ///< how often the device has started anew, by its stamps
  std::uint64_t dropped = 0;  ///< oldest frames of a full queue
  std::uint64_t suspect = 0, jumps = 0;
  double period_s = 0;  ///< from frame to frame, as they came
};

struct ReaderSettings {
  std::size_t queue_frames = 4096;
  double silence_s = 0;  ///< without a frame for so long: BoardSilent; 0: 3 s or ten frames, whichever is
                         ///< longer, the rig's board 1 s
};

/// Reads one sensor by a thread of its own. What ends it is PortUnplugged, BoardSilent or WrongDevice, the
/// last also where a clock has another unit than the file says.
class SensorReader {
 public:
  /// Starts to read. A full queue drops the oldest frame; from a port that is not live it waits instead.
  SensorReader(OpenedPort opened, const Sensor& sensor, const ReaderSettings& settings = {});
  /// Stops reading; frames that already arrived at the port are still read.
  ~SensorReader() { stop(); }
  SensorReader(const SensorReader&) = delete;
  SensorReader& operator=(const SensorReader&) = delete;

  /// Ends the thread; what it has read already can still be taken.
  void stop();
  /// The next frame, oldest first; empty after `wait_s` of wall time, or at the end. Rethrows what ended the
  /// reader once the frames before it have been taken.
  std::optional<ReadFrame> next(double wait_s);
  /// Rethrows what ended the reader, without waiting and without taking frames.
  void check();
  /// The source is at its end, without an error, and all frames have been taken.
  bool ended() const;
  bool live() const { return live_; }
  /// How long a live sensor may say nothing (s).
  double silence_s() const { return silence_s_; }
  ReaderCounters counters();

 private:
  void run();
  /// Reads once, until `until` at most, and hands over the frames that it completes. Returns when it was.
  double read(double until);
  void decode(std::span<const std::byte> bytes, double time_s);
  void take(std::size_t count);
  ReaderCounters counted() const;
  void check_silence(double time_s);
  void check_clock(double stamp_s, double arrival_s);

  // Of the thread that reads: the same reads give the same frames.
  std::unique_ptr<Port> port_;
  bool live_;
  Sensor sensor_;
  double silence_s_;
  std::unique_ptr<SensorDecoder> decoder_;
  FrameClock clock_;
  RestTracker rest_;
  std::vector<ReadFrame> frames_;  // of one read, and room for those of a larger one
  std::vector<FrameArrival> arrivals_;
  std::vector<FrameDate> dates_;
  ReaderCounters read_;                   // without what the decoder and the clock count
  std::optional<double> last_arrival_s_;  // of a frame that was handed over
  std::uint32_t skipped_ = 0;             // frames since then that were not
  std::string without_frame_;             // the first bytes of what came behind the newest frame
  double last_frame_s_;
  SensorDecoder::Counters decoded_;  // when the newest frame came
  double went_s_ = 0, first_arrival_s_ = 0, checked_time_s_ = 0, longest_step_s_ = 0;
  std::uint64_t checked_frames_ = 0;
  bool clock_checked_ = false;

  std::atomic<bool> stop_{false};

  mutable std::mutex mutex_;  // of all that follows
  std::condition_variable arrived_, taken_;
  std::deque<ReadFrame> queue_;
  std::size_t most_;
  bool ended_ = false;
  std::exception_ptr error_;
  ReaderCounters counters_;
  std::thread thread_;
};

/// What a port sends, as bytes, to be probed (data/frames/probe.h): what comes from the opened `port` within
/// `seconds`, in which the machine does not stand still, at most 16 MiB, or until `stop` says so. A datagram
/// of text is a line. Throws PortError, but for the end of a port: what came until then is what there is.
std::vector<Heard> listen(const OpenedPort& opened, const std::string& port, double seconds,
                          const std::function<bool()>& stop);

}  // namespace supertac
