// Any sensor, live: a thread reads, decodes and dates, a bounded queue hands frames over.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "data/frames/sensor_decoder.h"
#include "data/sensors/rest_tracker.h"
#include "hardware/boards/frame_queue.h"
#include "hardware/boards/tactile_board.h"
#include "hardware/ports/open_port.h"

namespace supertac {

struct ReadFrame {
  std::vector<float> signals;  ///< as Sensor::arrange() and RestTracker::follow(), in the sensor's unit
  double time_s = 0;           ///< of the sensor, increasing; from any zero
  double arrival_s = 0;        ///< on the port's clock
};

struct ReaderCounters {
  SensorDecoder::Counters decoder;
  std::uint64_t damaged = 0;  ///< frames with a signal that is no number; not handed over
  std::uint64_t late = 0;     ///< frames that FrameDates gives no date; not handed over
  std::uint64_t missing = 0;  ///< frames that never arrived, by the gaps in time
  std::uint64_t dropped = 0;  ///< oldest frames of a full queue
  double period_s = 0;        ///< from frame to frame, as they came
  /// The same, as the rig's board counts.
  operator BoardCounters() const;
};

/// Dates frames in the order they come: by the sensor's stamps where it sends any, else by arrival. Counters
/// of 16 or 32 bits may wrap, and a sensor may start anew. A stamp over 0.1 s and 10 periods ahead is
/// believed when it arrives as much later; so is one, or one over 0.1 s back, when the next goes on from it,
/// which costs a frame, or when three jump as far. A damaged stamp that is less far ahead costs the frames
/// that it overtakes. A frame can come late, not early: without stamps frames are a period apart below the
/// earliest arrivals; so are those of a burst behind a silence, when they are as many as it lasted periods.
class FrameDates {
 public:
  /// `stored`: the frames are those of a file; without stamps they are a period apart.
  explicit FrameDates(const Sensor& sensor, bool stored = false);
  /// Empty for a frame that is not later than the one before, or whose stamp jumps.
  /// `behind`: how many frames came behind it in the same burst; they are dated with the same arrival.
  std::optional<double> date(std::optional<double> stamp_s, double arrival_s, std::size_t behind = 0);
  std::uint64_t missing() const { return missing_; }
  /// By how much the newest date may be wrong because frames were lost in its burst.
  double doubt_s() const { return doubt_s_; }
  double period_s() const { return period_s_; }

 private:
  std::optional<double> by_stamp(double stamp_s, double arrival_s);
  double by_arrival(double arrival_s, std::size_t behind);
  void count_missing(double step_s, bool stamped);
  bool stored_;
  double nominal_s_, period_s_, wraps_s_ = 0;
  double coarse_s_ = 0;  // the unit of a clock that gives several frames one stamp, or nearly so
  double offset_s_ = 0, last_s_ = 0, last_arrival_s_ = 0, least_late_s_ = 0, most_late_s_ = 0, doubt_s_ = 0;
  std::optional<double> jumped_s_;       // a stamp that was not believed
  double jump_step_s_ = 0, step_s_ = 0;  // from the one before that to it, and where these are always as long
  double synchronised_s_ = 0;            // when dates were set to the arrivals
  std::uint64_t count_ = 0, in_block_ = 0, missing_ = 0, since_sync_ = 0;
  // The step before, how often in a row it was as long, and what was missing in these.
  double regular_step_s_ = 0;
  std::uint64_t regular_ = 0, regular_missing_ = 0;
  bool resynchronised_ = false;  // at this frame, and nothing was lost
};

/// Reads a port, and decodes and dates what comes. It has no thread: the same reads give the same frames.
class FrameReader {
 public:
  using Sink = std::function<void(const ReadFrame&)>;
  /// `stored` as FrameDates.
  explicit FrameReader(const Sensor& sensor, bool stored = false);
  /// One read, and behind a time without any what waited meanwhile (`live`). Hands over the frames that they
  /// complete and returns when they were read; throws what the port does, after these frames.
  double read(Port& port, bool live, const Sink& sink);
  /// The last line of a source that has ended may lack its end.
  void finish(double time_s, const Sink& sink);
  ReaderCounters counters() const;
  double doubt_s() const { return dates_.doubt_s(); }
  /// The first bytes of what came behind the newest frame.
  const std::string& without_frame() const { return without_frame_; }

 private:
  void take(const DecodedFrame& decoded, double arrival_s, std::size_t behind, const Sink& sink);

  Sensor sensor_;
  std::unique_ptr<SensorDecoder> decoder_;
  FrameDates dates_;
  RestTracker rest_;
  ReadFrame frame_;
  std::vector<std::optional<double>> times_read_s_;  // of frames that came at once, and their values
  std::vector<float> values_read_;
  double last_read_s_ = 0;
  std::string without_frame_;
  std::uint64_t damaged_ = 0, late_ = 0;
};

/// What ends it is PortUnplugged, BoardSilent or WrongDevice, the last also where a clock has another unit
/// than the file says.
class SensorReader : public FrameQueue<ReadFrame> {
 public:
  static constexpr std::size_t kQueueFrames = 4096;
  /// How long a live sensor may say nothing (s).
  static double silence_s(const Sensor& sensor);

  /// Starts to read. A full queue drops the oldest frame; from a port that is not live it waits instead.
  SensorReader(OpenedPort opened, const Sensor& sensor);
  ~SensorReader() { stop(); }
  bool live() const { return live_; }
  ReaderCounters counters();

 private:
  void run();
  void take(const ReadFrame& frame);
  void check_silence(double time_s);
  void check_clock(double time_s, double arrival_s);

  std::unique_ptr<Port> port_;
  bool live_;
  Sensor sensor_;
  FrameReader frames_;
  FrameReader::Sink sink_ = [this](const ReadFrame& frame) { take(frame); };
  double last_frame_s_;
  SensorDecoder::Counters decoded_;  // when the newest frame came
  double first_time_s_ = 0, first_arrival_s_ = 0, checked_time_s_ = 0, longest_step_s_ = 0;
  std::uint64_t checked_frames_ = 0;
  bool clock_checked_ = false;
  ReaderCounters counters_;
};

}  // namespace supertac
