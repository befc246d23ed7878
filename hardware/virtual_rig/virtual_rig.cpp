#include "hardware/virtual_rig/virtual_rig.h"

#include <algorithm>
#include <charconv>
#include <optional>

#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr double kStopHoldsS = 1, kStartDelayS = 0.107, kAcceleration = 500;  // of real ones

/// "M410" of "M0410 S1".
std::string code_of(const std::string& command) {
  int code = -1;
  (void)std::from_chars(command.data() + 1, command.data() + command.size(), code);
  return command[0] + std::to_string(code);
}

}  // namespace

std::optional<double> parameter(const std::string& command, std::string_view name) {
  const std::size_t at = command.find(name, 1);
  if (at == std::string::npos) return std::nullopt;
  double value = 0;
  const char *first = command.data() + at + name.size(), *last = command.data() + command.size();
  const auto [end, error] = std::from_chars(first, last, value, std::chars_format::fixed);
  return error == std::errc{} ? std::optional(value) : std::nullopt;
}

BoardFrame frame_of(const TaxelVolts& volts) {
  const auto code = [](double v) { return static_cast<std::uint16_t>(rig::adc_of(v)); };
  BoardFrame frame;
  frame.samples.fill(code(rig::kRestVolts));
  frame.slip = 2048;
  for (std::size_t k = 0; k < volts.size(); ++k) frame.samples[rig::kPatches * k] = code(volts[k]);
  return frame;
}

PlainRig::PlainRig(FingerSignals signals, double t)
    : signals_(std::move(signals)),
      motion_(rig::kMounted, kStartDelayS, 1, kAcceleration),
      start_s_(t),
      now_s_(t),
      zero_(rig::kMounted) {}

double PlainRig::next_event() const { return std::min(next_frame(), held_ ? held_until_s_ : next_frame()); }

void PlainRig::advance(double t) {
  for (double next = next_event(); next <= t; next = next_event()) {
    now_s_ = std::max(now_s_, next);
    if (held_ && held_until_s_ <= next) {
      held_ = false;
      output_ += "ok\n";
      run_waiting();
    } else {
      send_frame();
    }
  }
  now_s_ = std::max(now_s_, t);
}

void PlainRig::send_frame() {
  const double middle = next_frame() - 0.5 * rig::kFramePeriodS;
  const Point3 head = motion_.at(middle);
  ++frames_;
  std::array<std::byte, rig::kFrameBytes> bytes{};
  write_frame(frame_of(signals_(head.x, head.y, head.z, middle)), bytes);
  if (board_sink) board_sink(bytes, now_s_);
}

void PlainRig::to_printer(std::span<const std::byte> bytes) {
  for (const std::byte byte : bytes) {
    const char c = std::to_integer<char>(byte);
    if (c != '\n' && c != '\r') {
      partial_ += c;
    } else if (!halted_ && !partial_.empty()) {
      take_line(partial_);
      partial_.clear();
    }
  }
}

void PlainRig::take_line(const std::string& line) {
  std::string command = line.substr(0, line.find('*'));
  std::optional<double> number;
  if (command[0] == 'N') {
    number = parameter(" " + command, "N");
    command.erase(0, std::min(command.size(), command.find(' ') + 1));
  }
  if (command.empty()) return;
  const std::string code = code_of(command);
  if (number && code != "M110" && *number != line_ + 1) {
    if (*number != line_ && *number != line_ - 1)  // a repetition
      output_ += "Error:Line Number is not Last Line Number+1, Last Line: " + format(line_) +
                 "\nResend: " + format(line_ + 1) + "\nok\n";
    return;
  }
  line_ = number.value_or(line_);
  if (code == "M410") {  // acts ahead of the queue, and holds what comes behind it
    motion_.stop(now_s_);
    held_until_s_ = now_s_;
  }
  if (code == "M112") {
    motion_.stop(now_s_);
    output_ += "echo:M112 Shutdown\nError:Printer halted. kill() called!\n";
    halted_ = true;
    return;
  }
  waiting_.push_back(command);
  run_waiting();
}

void PlainRig::run_waiting() {
  while (!held_ && !waiting_.empty()) {
    const std::string command = waiting_.front();
    waiting_.pop_front();
    output_ += answer_to(command);
    if (!held_) output_ += "ok\n";
  }
}

std::string PlainRig::answer_to(const std::string& command) {
  const std::string code = code_of(command);
  if (code == "G0" || code == "G1") {
    move(command);
  } else if (code == "G28") {
    home();
  } else if (code == "G92") {
    const Point3 at = motion_.target();
    zero_ = {at.x - parameter(command, "X").value_or(at.x - zero_.x),
             at.y - parameter(command, "Y").value_or(at.y - zero_.y),
             at.z - parameter(command, "Z").value_or(at.z - zero_.z)};
  } else if (code == "M114") {
    const Point3 p = command.ends_with("R") ? motion_.at(now_s_) : motion_.target();
    return "X:" + format(p.x - zero_.x, 2) + " Y:" + format(p.y - zero_.y, 2) +
           " Z:" + format(p.z - zero_.z, 2) + " E:0.00 Count X:0 Y:0 Z:0\n";
  } else if (code == "M105") {
    return " T:25.00 /0.00 B:25.00 /0.00 @:0 B@:0\n";
  } else if (code == "M115") {
    return "FIRMWARE_NAME:Marlin 2.1.2 (virtual rig) PROTOCOL_VERSION:1.0\nCap:EMERGENCY_PARSER:1\n";
  } else if (code == "M400" || code == "M410") {
    held_ = true;
    held_until_s_ = code == "M410" ? now_s_ + kStopHoldsS : std::max(now_s_, motion_.end_time());
  } else if (code != "M110" && code != "G21" && code != "G90") {
    return "echo:Unknown command: \"" + command + "\"\n";
  }
  return {};
}

void PlainRig::move(const std::string& command) {
  feed_mm_s_ = parameter(command, "F").value_or(60 * feed_mm_s_) / 60;
  const Point3 from = motion_.target();
  const Point3 to{parameter(command, "X").value_or(from.x - zero_.x) + zero_.x,
                  parameter(command, "Y").value_or(from.y - zero_.y) + zero_.y,
                  parameter(command, "Z").value_or(from.z - zero_.z) + zero_.z};
  motion_.move_to(to, feed_mm_s_, now_s_);
}

void PlainRig::home() {
  motion_.home(now_s_);
  zero_ = {};
  held_ = true;
  held_until_s_ = motion_.end_time();
}

std::vector<std::byte> PlainRig::from_printer() {
  const auto bytes = std::as_bytes(std::span(output_));
  std::vector<std::byte> sent(bytes.begin(), bytes.end());
  output_.clear();
  return sent;
}

}  // namespace supertac
