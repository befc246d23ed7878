// A Marlin printer that carries the finger: absolute moves within limits, verified positions, stops.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "hardware/printers/marlin_link.h"

namespace supertac {

/// Where the head may go. Marlin ignores its soft limits until homed and clamps silently afterwards, so the
/// limits are the host's: every target and the whole way to it is checked before anything is sent.
/// A box; and below clearance_z() only over the plate, so that the finger never runs into the plate's side.
/// By default the rig's.
struct Limits {
  Point3 low{0, 0, 0}, high = rig::kBed;
  Point3 plate = rig::kPlate;  ///< its corner of least x and y, at the slide's height

  /// Lowest z (mm) that is free everywhere: 3.19 above the slide.
  double clearance_z() const;
  /// Checks both ends and the straight line between them. Throws OutsideLimits naming the axis, the value and
  /// the limit.
  void check_path(const Point3& from, const Point3& to) const;
  bool operator==(const Limits&) const = default;
};

constexpr double kToleranceMm = 0.05;  ///< positions so near are the same: answers are rounded

/// Where the firmware itself cuts moves of a homed machine, without a word.
struct SoftLimits {
  Point3 low, high;
  std::string text;  ///< as it said them

  bool cut(const Point3& p) const {
    const auto inside = [](double at, double from, double to) {
      return at >= from - kToleranceMm && at <= to + kToleranceMm;
    };
    return !(inside(p.x, low.x, high.x) && inside(p.y, low.y, high.y) && inside(p.z, low.z, high.z));
  }
};
/// M211; nothing where they are off or not told.
std::optional<SoftLimits> soft_limits_of(MarlinLink& link);

/// What another job may have left on in a printer, and a run depends on: each state is set before the first
/// length is sent, read back where the firmware tells it, and given back at the end. The states are a table,
/// in machine_state.cpp: state, how set, how read, what if not.
class MachineState {
 public:
  /// Sets every state that this firmware has; one that it does not know it does not have. Again, it sets them
  /// again (homing switches mesh compensation on) and remembers what it found the first time. `homed`: also
  /// refuses what shifts a homed machine and nothing else. Throws PrinterRefused that names a state which
  /// stays another, and as MarlinLink::command.
  void set(MarlinLink& link, bool homed);

  /// What was changed becomes as it was found, where that was told.
  void put_back(MarlinLink& link);
  /// What stays as it was set, "plane (G17), ...": what the firmware does not tell, or was not put back.
  std::string kept() const;

 private:
  struct Changed {
    std::string name;  // with the command that set it
    std::string back;  // commands; empty: nothing told what it was
  };
  std::vector<Changed> changed_;
};

constexpr double kStopWithin = 1.6;  ///< s, of the 2 in which Ctrl-C ends a program; M410 takes one of them

/// The line that makes a straight move.
std::string move_command(const Point3& target, double speed_mm_s);

// One straight move with acceleration: the trapezoid of speed over time.

/// Distance covered `t` seconds into a move of `distance` mm that lasts `duration` s: symmetric acceleration
/// `acceleration` (mm/s^2) at both ends, constant speed v between, where v solves
/// distance = v (duration - v / acceleration). Clamped to [0, distance].
double trapezoid_position(double t, double distance, double duration, double acceleration);

/// Duration (s) of a move of `distance` mm whose top speed is at most `speed` (mm/s).
double trapezoid_duration(double distance, double speed, double acceleration);

/// Where the head was (M114 R), and when: the middle of question and answer.
struct PositionSample {
  double time_s = 0;
  double round_trip_s = 0;
  Point3 position;
};

/// One printer: moves its head within the limits, and knows where it is. For one thread. Lengths are mm,
/// speeds mm/s, times s of the port's clock.
class Printer {
 public:
  /// How it is known where the head is: not at all, by the operator's word, by the firmware's homing.
  enum class Origin { unknown, confirmed, homed };
  struct Stop {
    bool confirmed = false;  ///< the head was shown to stand still
    std::string text;        ///< one line for the operator
  };

  /// `port` must outlive the printer.
  explicit Printer(Port& port, const Limits& limits = {}) : link_(port), limits_(limits) {}

  /// Finds the firmware and sets what another job may have left on in it; throws as MarlinLink::connect and
  /// MachineState::set. The origin is unknown then: Marlin cannot tell whether its coordinates mean anything.
  void connect();
  /// What connect() changed becomes as it was found, where that can be; returns what does not. Throws
  /// nothing.
  std::string put_back();

  /// Lifts, homes, and lifts again when the limits say so. Never homes x and y with z low. Whatever ends it
  /// early stops the head.
  void home();
  /// The operator's word that the head is at `here` (G92). Throws OutsideLimits, PositionError when M114
  /// differs.
  void confirm_origin(const Point3& here);
  Origin origin() const { return origin_; }

  /// Sends one straight move and returns when the firmware has taken it (it starts some 0.1 s later).
  /// Throws OriginUnknown or OutsideLimits before anything is sent; then as MarlinLink::command. Returns when
  /// it was sent and when the firmware said ok.
  MarlinLink::Answer start_move(const Point3& target, double speed_mm_s);

  /// Waits until the head stands (M400), then compares M114 with the last target. Throws PositionError when
  /// they differ by more than the tolerance three times running. Returns the time at which M400 was answered.
  double finish_move();

  /// Bounds what finish_move() may take now (s).
  double longest_s() const;

  /// M114 R; empty when the answer was damaged or later than `deadline_s` (0: 0.25 s).
  std::optional<PositionSample> sample_position(double deadline_s = 0);
  /// M114: the end of the queue, which is the head's position only after M400.
  Point3 queue_position(double deadline_s = 0);

  /// M114 until two answers in a row agree: a lost digit must never become a target. Throws PositionError.
  Point3 agreed_position(double deadline_s = 0);

  /// M410: stops where it is; Klipper, which has none, comes to the end of its move. Never throws for a
  /// firmware that does not answer; says so in the result.
  Stop quick_stop();
  /// M112: kills the firmware; afterwards only a reset helps.
  Stop emergency_stop();
  /// The way out of contact: stops a firmware that has a quick stop, and raises the finger to `z`, before
  /// anything is asked or waited for. Throws when that could not be verified.
  void lift_out(double z);

  const Point3& target() const { return target_; }
  const Limits& limits() const { return limits_; }
  MarlinLink& link() { return link_; }

 private:
  MarlinLink::Answer order(const std::string& move, const Point3& from, const Point3& to);
  void raise(const Point3& from, double z);
  bool stands_still();

  MarlinLink link_;
  Limits limits_;
  MachineState state_;
  std::string remark_;  // of the firmware, on the newest move
  Origin origin_ = Origin::unknown;
  Point3 target_;
  double expected_seconds_ = 0;  // of the moves since the last finish
};

}  // namespace supertac
