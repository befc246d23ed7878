// When a sensor made its frames. The model, of every sensor, port, journal and table:
//
//   arrival = offset + period * number + delay,   delay >= 0
//
// A frame can come late and never early, so that the clock is the lower envelope of the arrivals; frames that
// were lost are whole periods by which the envelope stays late. What cannot be told from this is an interval
// that goes with the frame. Where a sensor sends time stamps they are a better witness of `number` than the
// arrivals are: they are read as arrivals whose delay is below the unit of the stamp, after what ran over was
// put right, and what stamps and arrivals cannot both say is believed of neither.
//
// What is assumed:
//   - The period is within `tolerance` of the stated one, and steady to 2e-4 over a recording. A stated one
//     that fits what comes to 1 % is right. Where none does, and losses do not show one by one, fewer than a
//     tenth of the frames are lost all the time: by so much the period may be too long.
//   - One read in ten is later than J, of these one in ten later than 2 J, and so on; reads that are J apart
//     are late each on its own. J is measured. What this lets happen once in 1e13 times does not happen: of n
//     reads in a row one at least is late by no more than 13 J / n.
//   - A read takes all that has come, and what waits is handed over at once: a frame was not made before the
//     read in front of it, but for as much as frames of this stream have been late without that. A read of
//     several frames beside lost ones may not have: a buffer was full, and another may stand behind it.
//   - A first read of one frame had been waited for. How long those of a larger one have waited nobody knows:
//     their intervals have no begin.
//   - A stamp that is wrong has neighbours that are right.
// What is promised: the time at which a frame was made, up to the one smallest delay of the stream, lies in
// the frame's interval; no frame is counted as lost that arrived, but by FrameClock for as long as all frames
// are late.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "data/sensors/sensor.h"

namespace supertac {

struct ClockSettings {
  double period_s = rig::kFramePeriodS;  ///< as stated
  double tolerance = 0.005;              ///< the true one is up to (1 + tolerance) times as long or as short
  double stamp_unit_s = 0;               ///< 0: there are no stamps
  double stamp_range_s = 0;              ///< what a stamp runs over by (s); 0: it does not
  bool stored = false;                   ///< of a file: the arrivals say nothing
};
/// Of the rig's board, whose crystal is known, within 0.5 %; of others a stated rate is a word.
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

/// The unit of stamps, `unit_s` or less: a clock in seconds may have decimals.
double finer_unit(double stamp_s, double unit_s);

/// The stamps of one device in the order they come, as seconds that never run over or fall.
class DeviceStamps {
 public:
  explicit DeviceStamps(const ClockSettings& settings) : settings_(settings) {}
  struct Reading {
    std::optional<double> time_s = {};        ///< empty: not believed
    bool one_before_damaged = false;          ///< the stamp before, which was believed, is not any more
    std::optional<double> one_before_s = {};  ///< of the stamp before, which was not believed and is now
    bool reset = false;                       ///< the device had started anew at the stamp before
    bool anew = false;                        ///< reset, or nothing but the first stamp of all was wrong
  };
  /// `elapsed_s`: from the arrival of the frame before to that of this one.
  Reading read(double stamp_s, double elapsed_s, double period_s);
  double unit_s() const { return settings_.stamp_unit_s; }

 private:
  struct Mark {
    double raw_s = 0, time_s = 0;
  };
  double step_to(double raw_s, double from_s, double most_s) const;
  Reading accept(double raw_s, double time_s, Reading reading);
  ClockSettings settings_;
  Mark last_, before_;              // the newest that are believed
  std::optional<double> jumped_s_;  // the newest, which is not
  double step_s_ = 0, jump_step_s_ = 0, elapsed_s_ = 0, since_ = 0, now_s_ = 0, least_lag_s_ = 0;
  std::uint64_t believed_ = 0;
};

/// Reads that brought the frames up to the number `last`, as an envelope sees them.
struct ReadEnd {
  double first = 0, last = 0, time_s = 0;
  double gap_s = 0, slack_s = 0;  ///< since the read before; by how much `last` may be too large
};
struct Rate {
  double period_s = 0;
  double uncertain = 0;  ///< a share: how far off the period may be
  double wanders = 0;    ///< a share: how far from what reads say, with what is lost all the time in it
};

/// Dates frames as they come. With stamps the dates are of the device's clock, without those of the port's.
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
  struct Low {
    std::uint64_t burst;
    double level_s, last;
  };
  double level(const ReadEnd& burst) const { return burst.time_s - rate_.period_s * burst.last; }
  double jitter_s() const;
  void take(double first, double last, double time_s);
  void drop_front();
  void keep_low(const ReadEnd& burst);
  double periods_lost() const;
  void count_lost();
  void learn();
  FrameDate dated(double due_s, double from_s, double to_s);
  FrameDate by_stamp(const FrameArrival& frame);

  ClockSettings settings_;
  Rate rate_;
  double measured_s_;
  DeviceStamps stamps_;
  std::deque<ReadEnd> window_;  // the newest bursts
  std::deque<Low> lows_;        // of window_: rising levels, the lowest in front
  std::vector<ReadEnd> ends_;   // bursts that have left it, for the rate
  std::uint64_t closed_ = 0, ended_ = 0, lost_ = 0, damaged_ = 0, resets_ = 0;
  double number_ = 0, believed_number_ = 0, believed_s_ = 0, unbelieved_s_ = 0, arrived_s_ = 0;
  double level_s_ = 0, level_last_ = 0, jitter_of_late_s_ = 0, late_since_s_ = 0, most_waited_s_;
  std::vector<double> late_s_;  // of the reads that have left the window
  bool first_ = true, levelled_ = false, late_known_ = false;
  FrameDate last_;
};

/// All frames of a recording.
struct FrameTimeline {
  std::vector<FrameDate> dates;
  double period_s = rig::kFramePeriodS;    ///< what the dates use
  double measured_s = rig::kFramePeriodS;  ///< what the frames say
  bool plausible = true;  ///< measured_s is within the tolerance; else period_s is the stated
  std::uint64_t missing = 0, resets = 0;
};
/// Dates are of the port's clock; of what is stored, of the device's.
FrameTimeline timeline_of(const ClockSettings& settings, std::span<const FrameArrival> arrivals);

}  // namespace supertac
