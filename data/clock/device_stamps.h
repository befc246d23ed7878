// What a sensor's clock says, where its frames carry one: ranges that run over, resets, damaged stamps.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "data/clock/clock_model.h"
#include "data/sensors/sensor.h"

namespace supertac {

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
