// The commands that the virtual printer runs.
#include "tests/hardware/virtual_rig/virtual_printer.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <tuple>

#include "hardware/virtual_rig/virtual_rig.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr double kInch = 25.4;

// Of the answer of bugfix-2.0.x to M115: its name, and what it can do.
std::string marlin_capabilities(bool emergency_parser) {
  return "FIRMWARE_NAME:Marlin 2.1.2 (virtual rig) SOURCE_CODE_URL:github.com/MarlinFirmware/Marlin "
         "PROTOCOL_VERSION:1.0 MACHINE_TYPE:3D Printer EXTRUDER_COUNT:1 "
         "UUID:cede2a2f-41a2-4748-9b12-c55c62f367ff\nCap:SERIAL_XON_XOFF:0\nCap:AUTOREPORT_POS:1\n"
         "Cap:EMERGENCY_PARSER:" +
         std::string(emergency_parser ? "1" : "0") + "\nCap:HOST_ACTION_COMMANDS:0\nCap:ARCS:1\n";
}

}  // namespace

void VirtualPrinter::unknown(const std::string& command) {
  output_ += klipper() ? "// Unknown command:\"" + command.substr(0, command.find(' ')) + "\"\n"
                       : "echo:Unknown command: \"" + command + "\"\n";
}

void VirtualPrinter::run(const std::string& command, double t) {
  if (klipper() && run_klipper(command, t)) return;
  // Klipper knows commands by their text, not by their number: M0114 is none of them.
  if (klipper() && command.size() > 2 && command[1] == '0') return unknown(command);
  int code = -1;
  (void)std::from_chars(command.data() + 1, command.data() + command.size(), code);
  if (command[0] == 'G' && code >= 0) return run_g(code, command, t);
  if (command[0] == 'M' && code >= 0) return run_m(code, command, t);
  unknown(command);
}

void VirtualPrinter::run_g(int code, const std::string& command, double t) {
  executed_.push_back(command);
  if (code == 0 || code == 1) return move(command, t);
  if (code == 4)
    return block_until(std::max(t, motion_.end_time()) + parameter(command, "S").value_or(0) +
                           1e-3 * parameter(command, "P").value_or(0),
                       t);
  if (code == 28) return home(t);
  if (code == 92) return set_position(command);
  if (code == 20 || code == 21) {
    left_over_.inches = code == 20;
  } else if (code == 90 || code == 91) {
    left_over_.relative = code == 91;
  } else {
    executed_.pop_back();
    unknown(command);
  }
}

bool VirtualPrinter::run_klipper(const std::string& command, double t) {
  if (t < ready_s_ && !command.starts_with("M11")) {
    output_ +=
        "// Printer is not ready\n// The klippy host software is attempting to connect.  Please\n"
        "// retry in a few moments.\n!! Printer is not ready\n";
    return true;
  }
  const std::string name = command.substr(command.find(' ') + 1);
  Point3& offset = left_over_.offset;
  if (command.starts_with("SET_KINEMATIC_POSITION")) {
    set_position(command);
  } else if (command.starts_with("SAVE_GCODE_STATE")) {
    saved_[name] = {left_over_, base_};
  } else if (command.starts_with("RESTORE_GCODE_STATE") && !saved_.contains(name)) {
    output_ += "!! Unknown g-code state: " + name + "\n";
  } else if (command.starts_with("RESTORE_GCODE_STATE")) {
    saved_[name].first.mesh_mm = left_over_.mesh_mm;  // no part of it
    std::tie(left_over_, base_) = saved_[name];
  } else if (command.starts_with("SET_GCODE_OFFSET")) {
    base_ = {base_.x - offset.x, base_.y - offset.y, base_.z - offset.z};
    offset = {};
  } else if (command == "BED_MESH_CLEAR") {
    left_over_.mesh_mm = 0;
  } else if (command == "BED_MESH_PROFILE SAVE=supertac") {
    const bool probed = left_over_.mesh_mm != 0;
    if (probed) kept_mesh_mm_ = left_over_.mesh_mm;
    output_ += probed
                   ? "// Bed Mesh state has been saved to profile [supertac]\n// for the current session.\n"
                   : "// Unable to save to profile [supertac], the bed has not been probed\n";
  } else if (command == "BED_MESH_PROFILE LOAD=supertac") {
    left_over_.mesh_mm = kept_mesh_mm_;
  } else if (command == "BED_MESH_PROFILE REMOVE=supertac") {
    kept_mesh_mm_ = 0;
  } else if (command == "GET_POSITION") {
    output_ += "// gcode homing: X:" + format(offset.x, 6) + " Y:" + format(offset.y, 6) +
               " Z:" + format(offset.z, 6) + "\n";
  } else {
    return false;
  }
  return true;
}

// What stays from job to job, and its reports.
bool VirtualPrinter::run_state(int code, const std::string& command) {
  const std::optional<double> value = parameter(command, "S");
  const Point3& home = left_over_.home_offset;
  if (code == 220) {
    if (value) left_over_.speed_percent = *value;
    if (!value) output_ += "FR:" + format(left_over_.speed_percent) + "%\n";
  } else if (code == 221) {
    if (value) left_over_.flow_percent = *value;
    if (!value) output_ += "echo:E0 Flow: " + format(left_over_.flow_percent) + "%\n";
  } else if (code == 420 && !klipper()) {
    if (value) left_over_.mesh_mm = *value > 0 ? settings_.left_over.mesh_mm : 0;
    output_ += std::string("echo:Bed Leveling ") + (left_over_.mesh_mm == 0 ? "OFF" : "ON") +
               "\necho:Fade Height OFF\n";
  } else if (code == 211 && !klipper()) {
    output_ += "echo:Soft endstops: ON  Min: X0.00 Y0.00 Z0.00  Max: X" + format(settings_.bed.x, 2) + " Y" +
               format(settings_.bed.y, 2) + " Z" + format(settings_.bed.z, 2) + "\n";
  } else if (code == 503 && !klipper()) {
    output_ += std::string("echo:; Linear Units:\necho:  ") +
               (left_over_.inches ? "G20 ; (in)" : "G21 ; (mm)") + "\necho:; Home offset:\necho:  M206 X" +
               format(home.x, 2) + " Y" + format(home.y, 2) + " Z" + format(home.z, 2) + "\n";
  } else {
    return false;
  }
  return true;
}

void VirtualPrinter::set_position(const std::string& command) {
  const Point3 at = motion_.target();
  const bool kinematic = command[0] == 'S';
  const auto named = [&](char axis) {
    return parameter(command, kinematic ? std::string{' ', axis, '='} : std::string{axis});
  };
  const double unit = left_over_.inches && !kinematic ? kInch : 1;
  // Klipper's G92 is an offset of its own upon the position.
  const bool own = klipper() && !kinematic;
  Point3& shifted = own ? base_ : offset_;
  const Point3 from = own ? offset_ : Point3{};
  if (const auto x = named('X')) shifted.x = at.x - from.x - unit * *x;
  if (const auto y = named('Y')) shifted.y = at.y - from.y - unit * *y;
  if (const auto z = named('Z')) shifted.z = at.z - from.z - unit * *z;
  may_move_ = may_move_ || kinematic;
}

void VirtualPrinter::run_m(int code, const std::string& command, double t) {
  const bool only_marlin = code == 108 || code == 154 || code == 155 || code == 211 || code == 410;
  if (klipper() && only_marlin) return unknown(command);
  executed_.push_back(command);
  if (run_state(code, command)) return;
  if (code == 112) return kill(t, "echo:M112 Shutdown\n");
  if (code == 114)
    return report(settings_.realtime_position && command.find('R') != std::string::npos ? motion_.at(t)
                                                                                        : motion_.target());
  if (code == 154 && !settings_.deaf_to_m154)
    return report_every(parameter(command, "S").value_or(position_every_), temperature_every_);
  if (code == 155) return report_every(position_every_, parameter(command, "S").value_or(temperature_every_));
  if (code == 400) {
    const double end = std::max(t, motion_.end_time());
    return block_until(klipper() ? t + 0.1 * std::ceil((end - t) / 0.1) : end, t);
  }
  if (code == 410 && !settings_.emergency_parser) {  // else it has acted when it came
    motion_.stop(t);
    return block_until(t + kStopHoldsS, t);
  }
  if (code == 105) {
    ok_text_ = " T:25.00 /0.00 B:25.00 /0.00 @:0 B@:0";
  } else if (code == 115) {
    (klipper() ? ok_text_ : output_) += klipper() ? " FIRMWARE_NAME:Klipper FIRMWARE_VERSION:v0.12.0-virtual"
                                                  : marlin_capabilities(settings_.emergency_parser);
  } else if (code != 108 && code != 110 && code != 154 && code != 410) {
    executed_.pop_back();
    unknown(command);
  }
}

void VirtualPrinter::move(const std::string& command, double t) {
  if (klipper() && !homed_ && !may_move_) {
    executed_.pop_back();
    output_ += "!! Must home axis first: 0.000 0.000 0.000 [0.000]\n";
    return;
  }
  const double unit = left_over_.inches ? kInch : 1;
  if (const auto f = parameter(command, "F"); f && *f > 0) feed_ = unit * *f / 60;
  const Point3 from = motion_.target();
  const auto axis = [&](char letter, double physical, double offset, double limit) {
    const auto value = parameter(command, {&letter, 1});
    if (!value) return physical;
    double logical = left_over_.relative ? physical - offset + unit * *value : unit * *value;
    if (homed_) logical = std::clamp(logical, 0.0, limit);  // silently, and before homing not at all
    return logical + offset;
  };
  const Point3 zero = origin();
  const Point3 to{axis('X', from.x, zero.x, settings_.bed.x), axis('Y', from.y, zero.y, settings_.bed.y),
                  axis('Z', from.z, zero.z, settings_.bed.z)};
  motion_.move_to(to, feed_ * left_over_.speed_percent / 100, t);
}

void VirtualPrinter::home(double t) {
  if (settings_.homing_fails) return kill(t, "echo:Homing Failed\n");
  motion_.home(t);
  offset_ = {};
  base_ = left_over_.offset;
  const Point3& shift = left_over_.home_offset;
  offset_ = {-shift.x, -shift.y, -shift.z};
  homed_ = true;
  block_until(motion_.end_time(), t);
}

void VirtualPrinter::report(const Point3& physical) {
  const int digits = klipper() ? 3 : 2;
  const auto text = [digits](double v) { return format(std::abs(v) < 0.005 ? 0.0 : v, digits); };
  const Point3 zero = origin();
  const Point3 p{physical.x - zero.x, physical.y - zero.y, physical.z - zero.z};
  output_ += "X:" + text(p.x) + " Y:" + text(p.y) + " Z:" + text(p.z) + " E:" + text(0) +
             (klipper() ? "\n" : " Count X:0 Y:0 Z:0\n");
}

void VirtualPrinter::report_every(double position_s, double temperature_s) {
  position_every_ = position_s;
  temperature_every_ = temperature_s;
  position_due_ = position_s > 0 ? now_ + position_s : kNever;
  temperature_due_ = temperature_s > 0 ? now_ + temperature_s : kNever;
}

void VirtualPrinter::automatic_report(double t) {
  if (position_due_ <= t) {
    report(motion_.target());  // the end of the queue, as M154 reports it
    position_due_ = t + position_every_;
  } else {
    output_ += " T:25.00 /0.00 B:25.00 /0.00 @:0 B@:0\n";
    temperature_due_ = t + temperature_every_;
  }
}

void VirtualPrinter::pause_behind_move(double t) {
  waits_for_user_ = true;
  if (!blocked_) repeat_after_block_ = true;  // no command: no ok at its end
  block_until(kNever, t);
}

void VirtualPrinter::kill(double t, const std::string& why) {
  motion_.stop(t);
  output_ += why + "Error:Printer halted. kill() called!\n";
  halted_ = true;
}

void VirtualPrinter::overheat(double t) {
  kill(t, "Error:MAXTEMP triggered, system stopped! Heater_ID: E0\n\necho:Err: MAXTEMP\n");
}

// The planner's buffer is kept clean for a second; whatever held the firmware ends with it.
void VirtualPrinter::quick_stop(double t) {
  motion_.stop(t);
  if (!blocked_) repeat_after_block_ = true;
  block_until(t + kStopHoldsS, t);
}

}  // namespace supertac
