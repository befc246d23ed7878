#include "hardware/virtual_rig/virtual_printer.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>

#include "hardware/marlin_line.h"
#include "io/numbers.h"

namespace supertac {
namespace {

constexpr std::size_t kCommandBuffer = 4;  // Marlin's BUFSIZE
constexpr std::size_t kReceiveLines = 6;   // about 128 bytes
constexpr double kNever = std::numeric_limits<double>::infinity();

// The number behind a letter, as Marlin's parser reads it.
std::optional<double> parameter(const std::string& command, char letter) {
  const std::size_t at = command.find(letter, 1);
  if (at == std::string::npos) return std::nullopt;
  double value = 0;
  const char* last = command.data() + command.size();
  const auto [end, error] = std::from_chars(command.data() + at + 1, last, value, std::chars_format::fixed);
  return error == std::errc{} ? std::optional(value) : std::nullopt;
}

std::int64_t integer_at(const std::string& text, std::size_t at) {
  std::int64_t value = -1;
  if (at < text.size()) (void)std::from_chars(text.data() + at, text.data() + text.size(), value);
  return value;
}

// The code that Marlin's emergency parser sees in a line: spaces, a line number, an M and its digits. What
// follows the digits it knows does not matter to it, not even more digits.
std::string_view emergency_code(std::string_view line) {
  const auto skip = [&line](std::string_view characters) {
    line.remove_prefix(std::min(line.size(), line.find_first_not_of(characters)));
  };
  skip(" ");
  if (line.starts_with('N')) skip("N0123456789- ");
  if (!line.starts_with('M')) return {};
  line.remove_prefix(1);
  skip(" ");
  return line;
}

}  // namespace

VirtualPrinter::VirtualPrinter(const VirtualPrinterSettings& settings, double t, bool already_running)
    : settings_(settings), motion_(settings.head), dice_(settings.seed, 101), now_(t), boot_end_(t) {
  reset(t);
  if (already_running) {
    booting_ = false;
    output_.clear();
    last_line_ = 357;
  }
}

void VirtualPrinter::reset(double t) {
  offset_ = motion_.stop(t);
  queue_.clear();
  received_.clear();
  partial_.clear();
  emergency_.clear();
  blocked_ = repeat_after_block_ = homed_ = halted_ = relative_ = false;
  command_due_ = -1;
  last_line_ = 0;
  booting_ = true;
  boot_end_ = t + settings_.boot_s;
  wait_due_ = boot_end_ + 1;
  output_ += settings_.boot_garbage;
}

void VirtualPrinter::receive(std::string_view bytes, double t) {
  advance(t);
  if (booting_ || halted_ || unplugged_) return;
  for (const char c : bytes) on_character(c, t);
  advance(t);
}

void VirtualPrinter::on_character(char c, double t) {
  if (settings_.emergency_parser) watch_for_emergency(c, t);
  if (halted_) return;
  if (c != '\n' && c != '\r') {
    if (partial_.size() < kMaxLineBytes - 1) partial_.push_back(c);  // Marlin drops what does not fit
    return;
  }
  const std::string line = std::move(partial_);
  partial_.clear();
  // What arrives while a command holds the firmware waits in the receive buffer, and is lost when that is
  // full.
  if (!line.empty() && received_.size() < kReceiveLines) received_.push_back(line);
  take_received(t);
}

void VirtualPrinter::take_received(double t) {
  while (!received_.empty() && !blocked_ && !booting_ && queue_.size() < kCommandBuffer) {
    const std::string line = received_.front();
    received_.pop_front();
    accept_line(line, t);
  }
}

// Marlin scans every incoming byte for these, ahead of the queue and of any checksum.
void VirtualPrinter::watch_for_emergency(char c, double t) {
  if (c != '\n' && c != '\r') {
    if (emergency_.size() < kMaxLineBytes) emergency_.push_back(c);
    return;
  }
  std::string line;
  line.swap(emergency_);
  const std::string_view code = emergency_code(line);
  if (code.starts_with("112")) kill(t);
  if (code.starts_with("410")) quick_stop(t);
}

void VirtualPrinter::accept_line(const std::string& line, double t) {
  std::string command = line;
  if (line[0] == 'N') {
    if (!check_numbered(line, command)) return;
    if (hook_) hook_(last_line_, command, t);
    if (halted_ || booting_ || unplugged_) return;
  } else if (const std::size_t star = command.rfind('*'); star != std::string::npos) {
    command.resize(star);
  }
  queue_.push_back(command);
  if (command_due_ < 0 && !blocked_) command_due_ = t + settings_.reply_delay_s;
}

bool VirtualPrinter::check_numbered(const std::string& line, std::string& command) {
  const bool sets_number = line.find("M110") != std::string::npos;
  std::size_t digits = 1;
  if (sets_number) {
    const std::size_t second = line.find('N', line.find("M110") + 4);
    if (second != std::string::npos) digits = second + 1;
  }
  const std::int64_t number = integer_at(line, digits);
  if (number != last_line_ + 1 && !sets_number) {
    complain("Line Number is not Last Line Number+1");
    return false;
  }
  const std::size_t star = line.rfind('*');
  if (star == std::string::npos) {
    complain("No Checksum with line number");
    return false;
  }
  if (integer_at(line, star + 1) != marlin_checksum(line.substr(0, star))) {
    complain("checksum mismatch");
    return false;
  }
  last_line_ = number;
  const std::size_t space = line.find(' ');
  command = line.substr(space == std::string::npos ? 1 : space + 1,
                        star - (space == std::string::npos ? 1 : space + 1));
  return true;
}

void VirtualPrinter::complain(const std::string& what) {
  output_ += "Error:" + what + ", Last Line: " + std::to_string(last_line_) +
             "\nResend: " + std::to_string(last_line_ + 1) + "\nok\n";
}

void VirtualPrinter::advance(double t) {
  while (next_event() <= t && !unplugged_) {
    now_ = std::max(now_, next_event());
    if (booting_) {
      booting_ = false;
      output_ += "start\nMarlin 2.1.2\necho: Last Updated: virtual rig\necho:Compiled: none\n";
    } else if (blocked_ && blocked_until_ <= now_) {
      finish_block(now_);
    } else if (blocked_) {
      output_ += "echo:busy: processing\n";
      busy_due_ = now_ + 2;
    } else if (command_due_ >= 0 && command_due_ <= now_) {
      start_next(now_);
    } else {
      output_ += "wait\n";
      wait_due_ = now_ + 1;
    }
  }
  now_ = std::max(now_, t);
}

double VirtualPrinter::next_event() const {
  if (halted_ || unplugged_) return kNever;
  if (booting_) return boot_end_;
  if (blocked_) return settings_.keepalive ? std::min(blocked_until_, busy_due_) : blocked_until_;
  if (command_due_ >= 0) return command_due_;
  return settings_.heartbeat ? wait_due_ : kNever;
}

std::string VirtualPrinter::take_output() {
  std::string out = std::move(output_);
  output_.clear();
  return out;
}

Point3 VirtualPrinter::head(double t) { return motion_.at(t); }

void VirtualPrinter::start_next(double t) {
  if (random_trouble(t)) return;
  const std::string& front = queue_.front();
  const bool is_move = front.starts_with("G1") || front.starts_with("G0");
  if (is_move && motion_.full(t)) {  // its ok waits for room in the planner
    repeat_after_block_ = true;
    return block_until(motion_.next_end(), t);
  }
  const std::string command = front;
  queue_.pop_front();
  command_due_ = queue_.empty() ? -1 : t + settings_.reply_delay_s;
  wait_due_ = t + 1;
  run(command, t);
  if (!blocked_ && !halted_) reply_ok();
  take_received(t);
}

bool VirtualPrinter::random_trouble(double t) {
  const RigFaults& faults = settings_.faults;
  if (dice_.hit(faults.unplug_rate)) {
    unplugged_ = true;
    return true;
  }
  if (dice_.hit(faults.reset_rate)) {
    reset(t);
    return true;
  }
  if (dice_.hit(faults.stall_rate)) {
    command_due_ = t + 0.05;
    return true;
  }
  if (dice_.hit(faults.resend_storm_rate)) {
    for (int i = 0; i < 3; ++i) complain("checksum mismatch");
  }
  return false;
}

void VirtualPrinter::run(const std::string& command, double t) {
  const auto code = static_cast<int>(integer_at(command, 1));
  if (command[0] == 'G' && code >= 0) return run_g(code, command, t);
  if (command[0] == 'M' && code >= 0) return run_m(code, command, t);
  output_ += "echo:Unknown command: \"" + command + "\"\n";
}

void VirtualPrinter::run_g(int code, const std::string& command, double t) {
  executed_.push_back({t, command});
  switch (code) {
    case 0:
    case 1:
      return move(command, t);
    case 4:
      return block_until(std::max(t, motion_.end_time()) + parameter(command, 'S').value_or(0) +
                             1e-3 * parameter(command, 'P').value_or(0),
                         t);
    case 28:
      return home(t);
    case 90:
    case 91:
      relative_ = code == 91;
      return;
    case 92: {
      const Point3 at = motion_.target();
      if (const auto x = parameter(command, 'X')) offset_.x = at.x - *x;
      if (const auto y = parameter(command, 'Y')) offset_.y = at.y - *y;
      if (const auto z = parameter(command, 'Z')) offset_.z = at.z - *z;
      return;
    }
    default:
      executed_.pop_back();
      output_ += "echo:Unknown command: \"" + command + "\"\n";
  }
}

void VirtualPrinter::run_m(int code, const std::string& command, double t) {
  executed_.push_back({t, command});
  switch (code) {
    case 110:
    case 17:
    case 84:
    case 108:
    case 211:
      return;
    case 112:
      return kill(t);
    case 114:
      return report(settings_.realtime_position && command.find('R') != std::string::npos ? motion_.at(t)
                                                                                          : motion_.target());
    case 115:
      output_ += std::string("FIRMWARE_NAME:Marlin 2.1.2 (virtual rig)\nCap:EMERGENCY_PARSER:") +
                 (settings_.emergency_parser ? "1\n" : "0\n");
      return;
    case 400:
      return block_until(std::max(t, motion_.end_time()), t);
    case 410:
      return quick_stop(t);
    default:
      executed_.pop_back();
      output_ += "echo:Unknown command: \"" + command + "\"\n";
  }
}

void VirtualPrinter::move(const std::string& command, double t) {
  if (const auto f = parameter(command, 'F'); f && *f > 0) feed_ = *f / 60;
  const Point3 from = motion_.target();
  const auto axis = [&](char letter, double physical, double offset, double limit) {
    const auto value = parameter(command, letter);
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
  Point3 at = motion_.target();
  motion_.move_to({at.x, at.y, at.z + 5}, rig::kLiftMmS, t);
  motion_.move_to({0, 0, at.z + 5}, 50, t);
  motion_.move_to({0, 0, 0}, rig::kLiftMmS, t);
  offset_ = {};
  homed_ = true;
  block_until(motion_.end_time(), t);
}

void VirtualPrinter::report(const Point3& physical) {
  const auto text = [](double v) { return format(std::abs(v) < 0.005 ? 0.0 : v, 2); };
  const Point3 p{physical.x - offset_.x, physical.y - offset_.y, physical.z - offset_.z};
  output_ += "X:" + text(p.x) + " Y:" + text(p.y) + " Z:" + text(p.z) +
             " E:0.00 Count X:" + std::to_string(std::llround(80 * p.x)) +
             " Y:" + std::to_string(std::llround(80 * p.y)) +
             " Z:" + std::to_string(std::llround(400 * p.z)) + "\n";
}

void VirtualPrinter::block_until(double time, double now) {
  blocked_ = true;
  blocked_until_ = time;
  busy_due_ = now + 2;
}

void VirtualPrinter::finish_block(double t) {
  blocked_ = false;
  if (!repeat_after_block_) reply_ok();
  repeat_after_block_ = false;
  command_due_ = queue_.empty() ? -1 : t + settings_.reply_delay_s;
  take_received(t);
}

void VirtualPrinter::reply_ok() {
  if (!dice_.hit(settings_.faults.lost_ok_rate)) output_ += "ok\n";
}

void VirtualPrinter::kill(double t) {
  motion_.stop(t);
  output_ += "Error:Printer halted. kill() called!\n";
  halted_ = true;
}

void VirtualPrinter::quick_stop(double t) {
  motion_.stop(t);
  if (blocked_) blocked_until_ = t;
}

}  // namespace supertac
