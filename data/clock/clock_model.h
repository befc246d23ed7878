// What the live clock and that of a recording have in common: the assumptions of frame_clock.h as numbers,
// the period from reads, and what a sensor's own clock says, where its frames carry one: ranges that run
// over, resets, damaged stamps.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "data/sensors/sensor.h"

namespace supertac {

/// Reads that brought the frames up to the number `last`, as an envelope sees them.
struct ReadEnd {
  double first = 0, last = 0, time_s = 0;
  double gap_s = 0, slack_s = 0;  ///< since the read before; by how much `last` may be too large
};
struct Rate {
  double period_s = 0;
  double uncertain = 0;  ///< a share: how far off the period may be
};

/// How late the reads of a stream come, as the second assumption of frame_clock.h has it.
struct Lateness {
  double jitter_s = 0;  ///< J: one read in ten is later, one in a hundred later than 2 J, and so on
  double waited_s = 0;  ///< longest time that a frame waits in a port after the read before its own
  bool known = false;   ///< enough reads were seen to tell
  double unsure = 1;    ///< factor on J where few reads told it: 1 + 32 / n of n reads
};

namespace clock_model {

// The assumptions of the header.
constexpr std::size_t kReads = 16;
constexpr double kSteady = 2e-4;
constexpr double kDecades = 13;   // what has a chance of so many does not happen
constexpr double kOldestS = 0.6;  // a frame waited no longer before anything is known; stamps jump no farther
constexpr double kNever = 1e18, kMostStampS = 1e10;
constexpr double kSure = 18;           // median deviations
constexpr std::size_t kWitnesses = 3;  // reads, or stamps, in a row that bear each other out
constexpr double kDense = 0.15;
constexpr double kKnown = 0.05;        // a rate that is surer tells what was lost
constexpr double kClockDrifts = 0.01;  // at most, from the port's

/// Whether these frames, which came so long after a read that had emptied the port, are more than can have
/// been made since: then they had waited, too, and belong to that read.
inline bool waited_before(double frames, double seconds, double period_s) {
  return frames - seconds / period_s > 0.5;
}

/// As short as the period may be.
inline double shortest(const Rate& rate) { return rate.period_s * (1 - std::min(rate.uncertain, 0.95)); }

/// So long (s) must reads go on, whose delays are `jitter_s`, until one was on time: those that come sooner
/// after one another than they are late are late together.
inline double span_s(double jitter_s, double unit_s) {
  return unit_s > 0 ? kReads * unit_s : std::clamp(kReads * jitter_s, 0.25, 2.0);
}

/// Whether so many reads in a row, `seconds` in all, are late by `rise_s` for good: of those that are later
/// than `jitter_s`, which one in ten is, one in ten is later than twice that.
inline bool for_good(std::size_t reads, double seconds, double rise_s, double jitter_s) {
  const double alone =
      std::min({static_cast<double>(reads), 1.0 * kReads, 1 + seconds / std::max(jitter_s, 1e-9)});
  return reads >= kWitnesses && alone * rise_s > kDecades * jitter_s;
}

/// What a measured period is worth where nothing but the file's rate says whether frames are lost all the
/// time, which makes it too long: a stated one that is shorter by less than kDense is the period then, and
/// one that is another's says nothing. Losses show one by one where frames are late by less than a quarter of
/// a period.
inline Rate doubted(Rate found, double stated_s, double tolerance, double jitter_s) {
  const double off = found.period_s / stated_s;
  if (tolerance < kKnown || jitter_s < 0.25 * found.period_s) return found;
  const bool stated = off > 1 && off * (1 - kDense) < 1;
  found.uncertain = std::max(found.uncertain, stated ? 1 - (1 - kSteady) / off : kDense);
  return found;
}

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

struct ClockSettings {
  double period_s = rig::kFramePeriodS;  ///< as stated
  double tolerance = 0.005;              ///< the true one is up to (1 + tolerance) times as long or as short
  double stamp_unit_s = 0;               ///< 0: there are no stamps
  double stamp_range_s = 0;              ///< what a stamp runs over by (s); 0: it does not
  bool stored = false;                   ///< of a file: the arrivals say nothing
};

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

}  // namespace supertac
