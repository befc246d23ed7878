#include "tests/hardware/virtual_rig/virtual_printer.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numbers>
#include <utility>

#include "hardware/printers/marlin_link.h"

namespace supertac {
namespace {

constexpr std::size_t kCommandBuffer = 4;  // Marlin's BUFSIZE
constexpr std::size_t kReceiveLines = 6;   // about 128 bytes
constexpr double kReplyDelayS = 0.0003;

// The beginning of bugfix-2.0.x's 28 lines.
constexpr const char* kMarlinBanner =
    "start\nMarlin 2.1.2\n\necho: Last Updated: virtual rig | Author: (none)\necho:Compiled: none\n"
    "echo: Free Memory: 4096  PlannerBufferBytes: 1152\necho:Hardcoded Default Settings Loaded\n"
    "echo:; Linear Units:\necho:  G21 ; (mm)\necho:; Home offset:\necho:  M206 X0.00 Y0.00 Z0.00\n";

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

void FaultyMotion::hold(double t, double seconds) {
  rest_ = at(t);
  if (blocks_.empty()) return;
  for (Block& block : blocks_) {
    block.start += seconds;
    block.end += seconds;
  }
  end_ += seconds;
  Block& running = blocks_.front();
  if (running.start - seconds >= t) return;
  running = {rest_, running.to, t + seconds, running.end};
}

VirtualPrinter::VirtualPrinter(const VirtualPrinterSettings& settings, double t, bool already_running,
                               const RigFaults& faults, std::uint64_t seed)
    : settings_(settings),
      faults_(faults),
      motion_(settings.head,
              settings.start_delay_s > 0 ? settings.start_delay_s : (klipper() ? 0.253 : 0.107),
              settings.slowness, settings.acceleration),
      dice_(seed, 101),
      now_(t),
      boot_end_(t) {
  lines_.ignores_repetitions = settings.firmware == Firmware::marlin;
  if (klipper()) settings_.emergency_parser = settings_.keepalive = settings_.realtime_position = false;
  reset(t);
  if (already_running) {
    booting_ = false;
    left_over_ = settings.left_over;
    base_ = left_over_.offset;
    ready_s_ = t + settings.starts_s;
    report_every(settings.auto_position_s, settings.auto_temperature_s);
    output_.clear();
    lines_.last = 357;
  }
}

void VirtualPrinter::reset(double t) {
  offset_ = motion_.stop(t);
  report_every(0, 0);
  waits_for_user_ = false;
  queue_.clear();
  received_.clear();
  partial_.clear();
  emergency_.clear();
  blocked_ = repeat_after_block_ = homed_ = halted_ = may_move_ = false;
  left_over_ = {};
  base_ = {};
  saved_.clear();
  kept_mesh_mm_ = 0;
  command_due_ = -1;
  lines_.last = 0;
  booting_ = true;
  boot_end_ = t + settings_.boot_s;
  wait_due_ = boot_end_ + 1;
  if (klipper()) output_ += "// Klipper state: Disconnect\n";
  output_ += settings_.boot_garbage;
}

void VirtualPrinter::receive(std::string_view bytes, double t) {
  advance(t);
  if (booting_ || (halted_ && !klipper())) return;
  for (const char c : bytes) on_character(c, t);
  advance(t);
}

void VirtualPrinter::on_character(char c, double t) {
  if (settings_.emergency_parser) watch_for_emergency(c, t);
  if (halted_ && !klipper()) return;
  if (c != '\n' && c != '\r') {
    if (partial_.size() < kMaxLineBytes - 1) partial_.push_back(c);  // Marlin drops what does not fit
    return;
  }
  const std::string line = std::move(partial_);
  partial_.clear();
  if (klipper() && line.find("M112") != std::string::npos) return take_klipper_line(line, t);
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
  act_on_critical(emergency_code(line), t);
}

void VirtualPrinter::act_on_critical(std::string_view code, double t) {
  if (code.starts_with("112")) kill(t, "echo:M112 Shutdown\n");
  if (code.starts_with("410")) quick_stop(t);
  if (code.starts_with("108") && waits_for_user_) {
    waits_for_user_ = false;
    blocked_until_ = t;
  }
}

void VirtualPrinter::accept_line(const std::string& line, double t) {
  if (klipper()) return take_klipper_line(line, t);
  const auto [taken, complaint] = lines_.take(line);
  if (!complaint.empty()) complain(complaint);
  if (!taken) return;
  const std::string& command = *taken;
  if (line[0] == 'N' && hook_) hook_(lines_.last, command, t);
  if (halted_ || booting_) return;
  // Without an emergency parser an unnumbered stop acts when its line is read.
  if (!settings_.emergency_parser && (command == "M112" || command == "M410" || command == "M108")) {
    act_on_critical(std::string_view(command).substr(1), t);
    if (halted_) return;
  }
  queue_.push_back(command);
  if (command_due_ < 0 && !blocked_) command_due_ = t + kReplyDelayS;
}

// The number and the checksum are passed over. M112 acts ahead of the queue; then every line is refused.
void VirtualPrinter::take_klipper_line(const std::string& line, double t) {
  std::string command = line.substr(0, line.find('*'));
  if (command[0] == 'N') command.erase(0, std::min(command.size(), command.find(' ')) + 1);
  if (hook_) hook_(++lines_.last, command, t);
  if (command == "M112") halted_ = true, motion_.stop(t);
  if (halted_) {
    output_ +=
        "// Shutdown due to M112 command\n// Once the underlying issue is corrected, use the\n"
        "// \"FIRMWARE_RESTART\" command to reset the firmware\n!! Shutdown due to M112 command\nok\n";
    return;
  }
  queue_.push_back(command);
  if (command_due_ < 0 && !blocked_) command_due_ = t + kReplyDelayS;
}

void VirtualPrinter::complain(const std::string& text) {
  output_ += text;
  received_.clear();
  partial_.clear();
}

void VirtualPrinter::advance(double t) {
  while (next_event() <= t) {
    now_ = std::max(now_, next_event());
    if (booting_) {
      booting_ = false;
      output_ += klipper() ? "// Klipper state: Ready\n" : kMarlinBanner;
    } else if (std::min(position_due_, temperature_due_) <= now_) {
      automatic_report(now_);
    } else if (blocked_ && blocked_until_ <= now_) {
      finish_block(now_);
    } else if (blocked_) {
      output_ += waits_for_user_ ? "echo:busy: paused for user\n" : "echo:busy: processing\n";
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
  if (halted_) return kNever;
  if (booting_) return boot_end_;
  double next = kNever;
  if (blocked_) {
    next = settings_.keepalive ? std::min(blocked_until_, busy_due_) : blocked_until_;
  } else if (command_due_ >= 0) {
    next = command_due_;
  } else if (settings_.heartbeat) {
    next = wait_due_;
  }
  return std::min({next, position_due_, temperature_due_});
}

std::string VirtualPrinter::take_output() {
  std::string out = std::move(output_);
  output_.clear();
  return out;
}

Point3 VirtualPrinter::head(double t) {
  Point3 p = motion_.at(t);
  p.z += left_over_.mesh_mm * std::sin(std::numbers::pi * (p.y - rig::kPlate.y) / rig::kPlateLengthMm);
  return p;
}

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
  command_due_ = queue_.empty() ? -1 : t + kReplyDelayS;
  wait_due_ = t + 1;
  run(command, t);
  if (!blocked_ && !halted_) reply_ok();
  take_received(t);
}

bool VirtualPrinter::random_trouble(double t) {
  if (dice_.hit(faults_.reset_rate)) {
    reset(t);
    return true;
  }
  if (dice_.hit(faults_.action_rate)) {
    constexpr const char* kSaid[] = {"//action:cancel\n", "// action:cancel\n", "//action:pause\n",
                                     "//action:paused\n"};
    output_ += kSaid[dice_.below(4)];
  }
  if (dice_.hit(faults_.pause_rate)) {
    pause_behind_move(t);
    return true;
  }
  if (dice_.hit(faults_.stall_rate)) {
    command_due_ = t + 0.05;
    return true;
  }
  if (dice_.hit(faults_.freeze_rate)) {
    const double seconds = 0.3 + 1.7 * dice_.uniform();
    command_due_ = t + seconds;
    motion_.hold(t, seconds);
    return true;
  }
  if (dice_.hit(faults_.resend_storm_rate)) {
    for (int i = 0; i < 3; ++i) complain(lines_.complaint("checksum mismatch"));
  }
  return false;
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
  command_due_ = queue_.empty() ? -1 : t + kReplyDelayS;
  take_received(t);
}

void VirtualPrinter::reply_ok() {
  const std::string text = std::exchange(ok_text_, {});
  if (dice_.hit(faults_.lost_ok_rate)) return;
  output_ += "ok" + text + "\n";
}

}  // namespace supertac
