// When a sensor made its frames.
//
// The model: frame `number` of a sensor arrives at
//
//   arrival = offset + period * number + delay,   delay >= 0.
//
// A frame can come late and never early. The line under all arrivals is therefore the sensor's clock, and
// frames that were lost raise it by whole periods. Where a sensor sends time stamps, a stamp is an arrival
// whose delay is less than the stamp's unit. What the model cannot tell of a frame is an interval round its
// date.
//
// With a period of 10 ms frames 0 to 4 arrive at 0, 12, 35, 35 and 41 ms: 0, 2, 15, 5 and 1 ms after 10 ms
// for each number. The envelope stays at 0: frame 2 was late, and none was lost. Were frames 2 to 4, and all
// that follow, 10 ms later, it would rise by a period: one was lost between frames 1 and 2.
//
// The assumptions:
//   - The period is within `tolerance` of the stated one and steady to 2e-4 over a recording. Where reads
//     are so late that single losses do not show, either the stated period is right or fewer than one in
//     seven of the frames are lost.
//   - One read in ten is later than J, one in a hundred later than 2 J, and so on: that n reads, J apart,
//     are all later than x has the chance 10^(-n x / J). What has a chance below 1e-13 does not happen, so
//     one of them is late by no more than 13 J / n. J is measured on single reads and, as reads may be late
//     together, on the earliest of each 16. Where it is longer than a period and n reads told it, what it
//     says of 16 reads is taken 1 + 32 / n times.
//   - A read takes all that has come. So a frame was made after the read in front of its own, but for
//     Lateness::waited_s, which is extrapolated to 1e-13 in the same way. Behind a loss this does not hold:
//     a buffer of the adapter or the host may have been full, and another may stand behind it.
//   - How long frames had waited that came together in the first read is not known: their intervals have
//     no beginning.
//   - Of three stamps next to each other one is right, and frames are a period apart at least. Three that go
//     on from one another, but not from those before, show that the device has started anew. Live, a stamp
//     is believed to its unit where it goes on from the two before and came no later than the last ones: one
//     that is damaged by as much as was lost before it shows by its arrival only.
//
// The promise: every frame was made within its interval, up to one offset, the smallest delay of the stream.
// No frame that arrived is counted as lost, except that FrameClock, which knows no later ones, may count
// some while all that come are late. A simulator of boards, cables and hosts tests it (tests/data/clock).
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "data/clock/clock_model.h"

namespace supertac {

/// The tolerance is 0.5 % for the rig's board, whose crystal is known; the stated rate of others is a hint.
ClockSettings clock_settings(const Sensor& sensor, bool stored = false);

/// A frame as it came.
struct FrameArrival {
  double time_s = 0;          ///< when the read that brought it returned; one time for all of a read
  std::uint32_t damaged = 0;  ///< frames between the one before and this one that came, but not whole
  std::optional<double> stamp_s = {};  ///< what the sensor's clock says
};

struct FrameDate {
  double time_s = 0;            ///< when the sensor had finished the frame; increasing
  double from_s = 0, to_s = 0;  ///< the interval in which that lies
  std::uint64_t missing = 0;    ///< frames before it, since the first, that were lost or damaged
  double doubt_s() const { return std::max(to_s - time_s, time_s - from_s); }
};

/// Dates frames as they come. With stamps dates are on the device's clock, without stamps on the
/// port's.
class FrameClock {
 public:
  explicit FrameClock(const ClockSettings& settings);
  /// The frames of one read, which all have its time; `dates` gets one of each.
  void date(std::span<const FrameArrival> frames, std::vector<FrameDate>& dates);
  /// No more will come: what is lost at the end counts as far as it is certain.
  void finish();
  std::uint64_t missing() const { return lost_ + damaged_; }
  std::uint64_t resets() const { return resets_; }
  double period_s() const { return measured_s_; }

 private:
  double level(const ReadEnd& burst) const { return burst.time_s - rate_.period_s * burst.last; }
  double jitter_s() const;
  void take(double first, double last, double time_s);
  void drop_front();
  const ReadEnd& lowest() const;
  double periods_lost() const;
  void count_lost();
  void learn();
  FrameDate dated(double due_s, double from_s, double to_s);
  void take_stamp();
  FrameDate by_stamp(const FrameArrival& frame);

  ClockSettings settings_;
  Rate rate_;
  double measured_s_;
  DeviceStamps stamps_;
  std::deque<ReadEnd> window_;  // the newest bursts: frames that came in one read, or waited for one
  std::vector<ReadEnd> ends_;   // bursts that have left it, for the rate
  std::uint64_t ended_ = 0, lost_ = 0, damaged_ = 0, resets_ = 0;
  double number_ = 0, believed_s_ = 0, arrived_s_ = 0;
  double level_s_ = 0, level_last_ = 0;
  Lateness late_;
  std::deque<ReadEnd> stamped_;  // the newest stamps
  bool first_ = true, levelled_ = false;
  FrameDate last_;
};

/// All frames of a recording.
struct FrameTimeline {
  std::vector<FrameDate> dates;
  double period_s = rig::kFramePeriodS;    ///< what the dates use
  double measured_s = rig::kFramePeriodS;  ///< what the frames say
  bool plausible = true;  ///< measured_s is within the tolerance; else period_s is the stated one
  std::uint64_t missing = 0, resets = 0;
};
/// Dates are of the port's clock; of frames read from a file (`stored`), of the device's.
FrameTimeline timeline_of(const ClockSettings& settings, std::span<const FrameArrival> arrivals);

}  // namespace supertac
