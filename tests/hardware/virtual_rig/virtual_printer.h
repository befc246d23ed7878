// A printer that behaves like Marlin, as far as a host can tell: banner, line numbers, checksums, resend,
// busy, M114 and M114 R, M400, M410, M112, motion with acceleration, soft limits that do nothing until homed
// and clamp silently afterwards. Or like Klipper's host, which checks no number, reports the end of its
// queue, moves nothing before it is homed or told a position, and answers M400 at its next look, every 0.1 s.
// A state machine on a time that its owner advances: no threads, no clock of its own.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "hardware/virtual_rig/virtual_rig.h"
#include "tests/hardware/virtual_rig/faults.h"

namespace supertac {

/// Marlin ignores a repeated line since 2.1.2; before, it complained of its number.
enum class Firmware { marlin, marlin_before_2_1_2, klipper };

/// What another job left on in a firmware that is running already.
struct LeftOver {
  bool inches = false, relative = false;
  double speed_percent = 100, flow_percent = 100;
  double mesh_mm = 0;    ///< by which mesh compensation raises the middle of the plate; 0: it is off
  Point3 home_offset{};  ///< M206
  Point3 offset{};       ///< Klipper's SET_GCODE_OFFSET
  bool operator==(const LeftOver&) const = default;
};

struct VirtualPrinterSettings {
  Firmware firmware = Firmware::marlin;
  Point3 head = rig::kMounted;    ///< where the head really is at power-on; the firmware believes 0, 0, 0
  Point3 bed = rig::kBed;         ///< soft limits once homed: 0 ... bed
  bool realtime_position = true;  ///< M114 R reports the head, not the end of the queue
  bool emergency_parser = true;
  bool homing_fails = false;
  LeftOver left_over{};
  double acceleration = 500;   ///< of every move (mm/s^2)
  double starts_s = 0;         ///< for which Klipper's host still looks for its boards
  double auto_position_s = 0;  ///< M154 as an earlier host left it on a running firmware; 0: off
  bool deaf_to_m154 = false;   ///< these reports cannot be switched off
  double auto_temperature_s = 0;
  double start_delay_s = 0;    ///< from ok to a move's beginning; 0: what was measured, 0.107, Klipper 0.253
  double slowness = 1;         ///< moves take this many times as long: a starved board
  bool keepalive = true;       ///< echo:busy every 2 s
  bool heartbeat = false;      ///< `wait` every second when idle
  double boot_s = 0.4;         ///< power-on to `start`
  std::string boot_garbage{};  ///< bytes sent before the banner
};

/// A planner with room for so many moves, which may stand still.
class FaultyMotion : public MotionQueue {
 public:
  using MotionQueue::MotionQueue;
  bool full(double t) { return (void)at(t), blocks_.size() >= 16; }
  /// When the move now running ends; end_time() when none runs.
  double next_end() const { return blocks_.empty() ? end_ : blocks_.front().end; }
  /// Stands for so long, then goes on.
  void hold(double t, double seconds);
};

class VirtualPrinter {
 public:
  /// Switched on at time t. `already_running`: booted long ago, no banner, line number 357. Of the faults
  /// lost ok, storms, resets and stalls; bytes are the port's matter.
  VirtualPrinter(const VirtualPrinterSettings& settings, double t, bool already_running = false,
                 const RigFaults& faults = {}, std::uint64_t seed = 1);

  /// Bytes from the host, arriving at time t (not before the last advance).
  void receive(std::string_view bytes, double t);
  /// Runs until time t.
  void advance(double t);
  /// Replies that have left the printer so far.
  std::string take_output();
  /// The next time something happens by itself; infinity when idle.
  double next_event() const;

  /// Where the head really is (plate frame of the simulator).
  Point3 head(double t);
  bool moving(double t) { return motion_.end_time() > t; }
  bool halted() const { return halted_; }
  /// Restarts the firmware at time t: the position is forgotten, moves stop where they are.
  void reset(double t);
  /// Called with every numbered line that is about to run, and its time; the tests' hook for planting faults.
  void on_line(std::function<void(std::int64_t, const std::string&, double)> hook) {
    hook_ = std::move(hook);
  }
  /// Reports of position and temperature every so many seconds (M154, M155); 0: none.
  void report_every(double position_s, double temperature_s);
  /// A sensor beyond its range: the firmware says so and halts.
  void overheat(double t);
  /// A pause in the middle of a move, of a display or a filament sensor: it ends, then M108 is waited for.
  void pause_behind_move(double t);
  /// What is left on in it now.
  const LeftOver& left_over() const { return left_over_; }
  /// Puts raw text into the reply stream.
  void inject(const std::string& text) { output_ += text; }

  /// The commands that ran, oldest first: tests prove by it that nothing runs twice.
  const std::vector<std::string>& executed() const { return executed_; }
  std::int64_t last_line() const { return lines_.last; }

 private:
  static constexpr double kNever = std::numeric_limits<double>::infinity();
  static constexpr double kStopHoldsS = 1;  // M410 the firmware

  void on_character(char c, double t);
  void watch_for_emergency(char c, double t);
  void act_on_critical(std::string_view code, double t);
  void take_received(double t);
  void accept_line(const std::string& line, double t);
  void complain(const std::string& text);
  void take_klipper_line(const std::string& line, double t);
  void start_next(double t);
  bool klipper() const { return settings_.firmware == Firmware::klipper; }
  void unknown(const std::string& command);
  void run(const std::string& command, double t);
  void run_g(int code, const std::string& command, double t);
  void run_m(int code, const std::string& command, double t);
  void move(const std::string& command, double t);
  void home(double t);
  void set_position(const std::string& command);
  bool run_state(int code, const std::string& command);
  bool run_klipper(const std::string& command, double t);
  Point3 origin() const { return {offset_.x + base_.x, offset_.y + base_.y, offset_.z + base_.z}; }
  void report(const Point3& physical);
  void block_until(double time, double now);
  void finish_block(double t);
  void reply_ok();
  void automatic_report(double t);
  void kill(double t, const std::string& why);
  void quick_stop(double t);
  bool random_trouble(double t);

  VirtualPrinterSettings settings_;
  RigFaults faults_;
  FaultyMotion motion_;
  Dice dice_;
  Point3 offset_, base_;  // logical = physical - offset - base; base_: Klipper's own
  LeftOver left_over_;
  std::map<std::string, std::pair<LeftOver, Point3>> saved_;  // of Klipper, with its base, by NAME=
  double kept_mesh_mm_ = 0;                                   // of its profile
  double ready_s_ = 0;                                        // of Klipper
  std::deque<std::string> received_;                          // whole lines not yet looked at
  std::deque<std::string> queue_;                             // accepted, not yet run
  std::string partial_;
  std::string emergency_;
  std::string output_;
  std::vector<std::string> executed_;
  std::function<void(std::int64_t, const std::string&, double)> hook_;
  double now_;
  double boot_end_;
  double command_due_ = -1;    // when the command at the queue's front runs; < 0: none waits
  double blocked_until_ = -1;  // G4, M400, G28 hold the queue
  double busy_due_ = 0;
  double wait_due_ = 0;
  double feed_ = 10;
  double position_every_ = 0, position_due_ = 0, temperature_every_ = 0, temperature_due_ = 0;  // 0: off
  NumberedLines lines_;
  bool booting_ = false, blocked_ = false, homed_ = false, halted_ = false;
  bool repeat_after_block_ = false;  // what holds the firmware is no command: no ok at its end
  bool waits_for_user_ = false;
  bool may_move_ = false;  // Klipper was told a position
  std::string ok_text_;    // behind the next ok
};

}  // namespace supertac
