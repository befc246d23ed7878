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
#include <cmath>
#include <cstdint>
#include <deque>
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

// What the live clock and that of a recording have in common: the assumptions as numbers, the period from
// reads, and what a sensor's own clock says, where its frames carry one: ranges that run over, resets,
// damaged stamps.

/// Reads that brought the frames up to the number `last`, as an envelope sees them.
struct ReadEnd {
  double first = 0, last = 0, time_s = 0;
  double gap_s = 0, slack_s = 0;  ///< since the read before; by how much `last` may be too large
  /// Of the line under all reads at number 0, were it through this one.
  double level_s(double period_s) const { return time_s + slack_s - period_s * last; }
};
struct Rate {
  double period_s = 0;
  double uncertain = 0;  ///< a share: how far off the period may be
};

/// How late the reads of a stream come, as the second assumption above has it.
struct Lateness {
  double jitter_s = 0;  ///< J: one read in ten is later, one in a hundred later than 2 J, and so on
  double waited_s = 0;  ///< longest time that a frame waits in a port after the read before its own
  bool known = false;   ///< enough reads were seen to tell
  double unsure = 1;    ///< factor on J where few reads told it: 1 + 32 / n of n reads
};

namespace clock_model {

// The assumptions above.
constexpr std::size_t kReads = 16;
constexpr double kDecades = 13;   // what has a chance of so many does not happen
constexpr double kOldestS = 0.6;  // a frame waited no longer before anything is known; stamps jump no farther
constexpr double kNever = 1e18, kMostStampS = 1e10;
constexpr std::size_t kWitnesses = 3;  // reads, or stamps, in a row that bear each other out
constexpr double kKnown = 0.05;        // a rate that is surer tells what was lost
constexpr double kClockDrifts = 0.01;  // at most, from the port's

/// Takes a read behind others. Of one time they are one; so they are where it brings more frames than can
/// have been made since the port had been emptied, which is `least_s` each (0: not known): these had waited,
/// too.
template <class Reads>
void add_read(Reads& reads, ReadEnd read, double least_s) {
  if (!reads.empty()) {
    const ReadEnd before = reads.back();
    read.gap_s = read.time_s - before.time_s;
    const bool waited = least_s > 0 && read.last - before.last - read.gap_s / least_s > 0.5;
    if (read.gap_s == 0 || waited) {
      read.first = before.first, read.gap_s = before.gap_s;
      reads.pop_back();
    }
  }
  reads.push_back(read);
}

/// As short as the period may be.
inline double shortest(const Rate& rate) { return rate.period_s * (1 - std::min(rate.uncertain, 0.95)); }

/// So long (s) must reads go on, whose delays are `jitter_s`, until one was on time: those that come sooner
/// after one another than they are late are late together.
double span_s(double jitter_s, double unit_s);

/// Whether so many reads in a row, `seconds` in all, are late by `rise_s` for good: of those that are later
/// than `jitter_s`, which one in ten is, one in ten is later than twice that.
bool for_good(std::size_t reads, double seconds, double rise_s, double jitter_s);

/// What a measured period is worth where nothing but the file's rate says whether frames are lost all the
/// time, which makes it too long: a stated one that is shorter by less than 15 % is the period then, and
/// one that is another's says nothing. Losses show one by one where frames are late by less than a quarter of
/// a period.
Rate doubted(Rate found, double stated_s, double tolerance, double jitter_s);

/// By so much the stamps of a coarse clock wander against the frames.
inline double grain(double unit_s, double period_s) {
  return unit_s > 0.25 * period_s && unit_s < kNever ? unit_s : 0;
}

/// The period, as the earliest of every few reads tell it: the median slope between two that lie as far apart
/// as makes it surest, at most `farthest` of the whole. A loss spoils the slopes across it only, so that they
/// may not lie too far apart. Reads are `unit_s` off at most. kNever uncertain: there are too few.
Rate slope_of(std::span<const ReadEnd> ends, double period_s, double farthest, double unit_s);

/// How late `ends` are: each against the earliest of a window of kReads and more, which lasts `span_s`. Where
/// reads are late together, the earliest is late, too: by as much as that of the next window is earlier. The
/// most of this, were it as rare as 1 of the windows and three decades, shows a jitter of its own.
Lateness lateness_of(std::span<const ReadEnd> ends, const Rate& rate, double span_s);

}  // namespace clock_model

/// The unit of stamps, `unit_s` or less: a clock in seconds may have decimals.
double finer_unit(double stamp_s, double unit_s);

/// The stamps of one device in the order they come, as seconds that never run over or fall.
class DeviceStamps {
 public:
  explicit DeviceStamps(const ClockSettings& settings) : settings_(settings) {}
  /// Of the stamp that was read so many before: what it says after all; empty: it was damaged.
  struct Revision {
    std::uint64_t back = 0;
    std::optional<double> time_s = {};
  };
  struct Reading {
    std::optional<double> time_s = {};   ///< empty: not believed
    std::vector<Revision> revised = {};  ///< the newest first
    bool reset = false;                  ///< the device had started anew at the last of `revised`
    bool anew = false;                   ///< reset, or nothing but the first stamps of all were wrong
  };
  /// `elapsed_s`: from the arrival of the frame before to that of this one.
  Reading read(double stamp_s, double elapsed_s, const Rate& rate);
  double unit_s() const { return settings_.stamp_unit_s; }
  /// On the device's clock, later than any frame that has arrived.
  double latest_s() const;

 private:
  struct Mark {
    double raw_s = 0, off_s = 0, arrived_s = 0, step_s = 0;
    double least_lag_s = 0;  // of its chain, behind the arrivals
    std::uint64_t number = 0, before = 0, root = 0, length = 0;
    double time_s() const { return raw_s + off_s; }
  };
  double step_from(const Mark& one, double raw_s, double most_s) const;
  Mark chained(double raw_s, const Rate& rate) const;
  ClockSettings settings_;
  std::vector<Mark> marks_;  // the newest, believed or not
  Mark head_;                // the newest that is believed
  double now_s_ = 0, elapsed_s_ = 0;
  std::uint64_t number_ = 0;
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
  double level(const ReadEnd& read) const { return read.level_s(rate_.period_s); }
  double jitter_s() const;
  void take(double first, double last, double time_s);
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
  std::deque<ReadEnd> window_;  // the newest reads: frames that came in one, or waited for it
  std::vector<ReadEnd> ends_;   // reads that have left it, for the rate
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
