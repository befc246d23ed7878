// The commands that the virtual printer runs.
#include "hardware/virtual_rig/virtual_printer.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>

#include "hardware/printers/marlin_line.h"
#include "hardware/virtual_rig/marlin_texts.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

// The number behind a letter, as Marlin's parser reads it.
std::optional<double> parameter(const std::string& command, const std::string& name) {
  const std::size_t at = command.find(name, 1);
  if (at == std::string::npos) return std::nullopt;
  double value = 0;
  const char* last = command.data() + command.size();
  const auto [end, error] =
      std::from_chars(command.data() + at + name.size(), last, value, std::chars_format::fixed);
  return error == std::errc{} ? std::optional(value) : std::nullopt;
}

}  // namespace

void VirtualPrinter::unknown(const std::string& command) {
  output_ += klipper() ? "// Unknown command:\"" + command.substr(0, command.find(' ')) + "\"\n"
                       : "echo:Unknown command: \"" + command + "\"\n";
}

void VirtualPrinter::run(const std::string& command, double t) {
  if (klipper() && command.starts_with("SET_KINEMATIC_POSITION")) return set_position(command);
  // Klipper knows commands by their text, not by their number: M0114 is none of them.
  if (klipper() && command.size() > 2 && command[1] == '0') return unknown(command);
  int code = -1;
  (void)std::from_chars(command.data() + 1, command.data() + command.size(), code);
  if (command[0] == 'G' && code >= 0) return run_g(code, command, t);
  if (command[0] == 'M' && code >= 0) return run_m(code, command, t);
  unknown(command);
}

void VirtualPrinter::run_g(int code, const std::string& command, double t) {
  executed_.push_back({t, command});
  switch (code) {
    case 0:
    case 1:
      return move(command, t);
    case 4:
      return block_until(std::max(t, motion_.end_time()) + parameter(command, "S").value_or(0) +
                             1e-3 * parameter(command, "P").value_or(0),
                         t);
    case 28:
      return home(t);
    case 21:
      return;
    case 90:
    case 91:
      relative_ = code == 91;
      return;
    case 92:
      return set_position(command);
    default:
      executed_.pop_back();
      unknown(command);
  }
}

void VirtualPrinter::set_position(const std::string& command) {
  const Point3 at = motion_.target();
  const bool kinematic = command[0] == 'S';
  const auto named = [&](char axis) {
    return parameter(command, kinematic ? std::string{' ', axis, '='} : std::string{axis});
  };
  if (const auto x = named('X')) offset_.x = at.x - *x;
  if (const auto y = named('Y')) offset_.y = at.y - *y;
  if (const auto z = named('Z')) offset_.z = at.z - *z;
  may_move_ = may_move_ || kinematic;
}

void VirtualPrinter::run_m(int code, const std::string& command, double t) {
  const bool only_marlin =
      code == 0 || code == 17 || code == 108 || code == 154 || code == 155 || code == 211 || code == 410;
  if (klipper() && only_marlin) return unknown(command);
  executed_.push_back({t, command});
  switch (code) {
    case 0:
      return pause(command, t);
    case 105:
      ok_text_ = " T:25.00 /0.00 B:25.00 /0.00 @:0 B@:0";
      return;
    case 154:
      if (settings_.deaf_to_m154) return;
      return report_every(parameter(command, "S").value_or(position_every_), temperature_every_);
    case 155:
      return report_every(position_every_, parameter(command, "S").value_or(temperature_every_));
    case 110:
    case 17:
    case 84:
    case 108:
    case 211:
      return;
    case 112:
      return kill(t, "echo:M112 Shutdown\n");
    case 114:
      return report(settings_.realtime_position && command.find('R') != std::string::npos ? motion_.at(t)
                                                                                          : motion_.target());
    case 115:
      if (klipper()) {
        ok_text_ = " FIRMWARE_NAME:Klipper FIRMWARE_VERSION:v0.12.0-virtual";
        return;
      }
      output_ += marlin_capabilities(settings_.emergency_parser);
      return;
    case 400: {
      const double end = std::max(t, motion_.end_time());
      return block_until(klipper() ? t + 0.1 * std::ceil((end - t) / 0.1) : end, t);
    }
    case 410:
      motion_.stop(t);
      return block_until(t + settings_.quick_stop_s, t);
    default:
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
  if (const auto f = parameter(command, "F"); f && *f > 0) feed_ = *f / 60;
  const Point3 from = motion_.target();
  const auto axis = [&](char letter, double physical, double offset, double limit) {
    const auto value = parameter(command, {letter});
    if (!value) return physical;
    double logical = relative_ ? physical - offset + *value : *value;
    if (homed_) logical = std::clamp(logical, 0.0, limit);  // silently, and before homing not at all
    return logical + offset;
  };
  const Point3 to{axis('X', from.x, offset_.x, settings_.bed.x),
                  axis('Y', from.y, offset_.y, settings_.bed.y),
                  axis('Z', from.z, offset_.z, settings_.bed.z)};
  const double length = distance(from, to);
  const double rise = std::abs(to.z - from.z);
  const double speed = rise > 0 ? std::min(feed_, rig::kLiftMmS * length / rise) : feed_;
  motion_.move_to(to, speed, t);
}

void VirtualPrinter::home(double t) {
  if (settings_.homing_fails) return kill(t, "echo:Homing Failed\n");
  Point3 at = motion_.target();
  motion_.move_to({at.x, at.y, at.z + 5}, rig::kLiftMmS, t);
  motion_.move_to({0, 0, at.z + 5}, 50, t);
  motion_.move_to({0, 0, 0}, rig::kLiftMmS, t);
  offset_ = steps_zero_ = {};
  homed_ = true;
  block_until(motion_.end_time(), t);
}

void VirtualPrinter::report(const Point3& physical) {
  const int digits = klipper() ? 3 : 2;
  const auto text = [digits](double v) { return format(std::abs(v) < 0.005 ? 0.0 : v, digits); };
  const Point3 p{physical.x - offset_.x, physical.y - offset_.y, physical.z - offset_.z};
  output_ += "X:" + text(p.x) + " Y:" + text(p.y) + " Z:" + text(p.z) + " E:" + text(0);
  if (klipper()) {
    output_ += "\n";
    return;
  }
  output_ += " Count X:" + std::to_string(std::llround(80 * (physical.x - steps_zero_.x))) +
             " Y:" + std::to_string(std::llround(80 * (physical.y - steps_zero_.y))) +
             " Z:" + std::to_string(std::llround(400 * (physical.z - steps_zero_.z))) + "\n";
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

// M0 needs somebody who can answer: a display's button, or M108 through the emergency parser.
void VirtualPrinter::pause(const std::string& command, double t) {
  if (!settings_.display && !settings_.emergency_parser) {
    executed_.pop_back();
    unknown(command);
    return;
  }
  waits_for_user_ = true;
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
  block_until(t + settings_.quick_stop_s, t);
}

}  // namespace supertac
