#include "hardware/virtual_rig/virtual_rig.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <optional>
#include <utility>

#include "hardware/ports/errors.h"
#include "hardware/ports/serial_port.h"
#include "hardware/printers/printer.h"
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

[[noreturn]] void failed(const std::string& what) {
  throw PortError("virtual rig: " + what + ": " + strerror(errno));
}

void link_at(const std::string& target, const std::string& link) {
  std::error_code error;
  if (std::filesystem::is_symlink(link, error)) std::filesystem::remove(link, error);
  std::filesystem::create_symlink(target, link, error);
  if (error)
    throw PortError("virtual rig: cannot link " + link + ": " + error.message() + "; choose another path");
}

}  // namespace

Point3 MotionQueue::at(double t) {
  while (!blocks_.empty() && t >= blocks_.front().end) {
    rest_ = blocks_.front().to;
    blocks_.pop_front();
  }
  if (blocks_.empty() || t <= blocks_.front().start) return rest_;
  const Block& block = blocks_.front();
  const double length = distance(block.from, block.to);
  const double done = trapezoid_position(t - block.start, length, block.end - block.start, acceleration_);
  return between(block.from, block.to, length > 0 ? done / length : 1);
}

void MotionQueue::move_to(const Point3& to, double speed_mm_s, double t) {
  rest_ = blocks_.empty() ? at(t) : rest_;
  const Point3 from = target();
  if (from == to) return;
  const double start = blocks_.empty() ? t + start_delay_s_ : blocks_.back().end;
  const double length = distance(from, to), rise = std::abs(to.z - from.z);
  const double speed = rise > 0 ? std::min(speed_mm_s, rig::kLiftMmS * length / rise) : speed_mm_s;
  end_ = start + slowness_ * trapezoid_duration(length, speed, acceleration_);
  blocks_.push_back({from, to, start, end_});
}

void MotionQueue::home(double t) {
  const Point3 at = target();
  move_to({at.x, at.y, at.z + 5}, rig::kLiftMmS, t);
  move_to({0, 0, at.z + 5}, rig::kFastestMmS, t);
  move_to({}, rig::kLiftMmS, t);
}

Point3 MotionQueue::stop(double t) {
  rest_ = at(t);
  blocks_.clear();
  end_ = t;
  return rest_;
}

std::optional<double> parameter(const std::string& command, std::string_view name) {
  const std::size_t at = command.find(name, 1);
  if (at == std::string::npos) return std::nullopt;
  double value = 0;
  const char *first = command.data() + at + name.size(), *last = command.data() + command.size();
  const auto [end, error] = std::from_chars(first, last, value, std::chars_format::fixed);
  return error == std::errc{} ? std::optional(value) : std::nullopt;
}

std::string NumberedLines::complaint(const std::string& what) const {
  return "Error:" + what + ", Last Line: " + std::to_string(last) + "\nResend: " + std::to_string(last + 1) +
         "\nok\n";
}

NumberedLines::Taken NumberedLines::take(const std::string& received) {
  const std::string line = received.c_str();  // as Marlin, for which a 0 byte ends it
  const std::size_t star = line.rfind('*'), space = line.find(' '), sets = line.find("M110");
  if (line[0] != 'N') return {line.substr(0, star), {}};
  std::optional<double> number = sets == std::string::npos ? std::nullopt : parameter(line.substr(sets), "N");
  if (!number) number = parameter(" " + line, "N");
  const auto at = static_cast<std::int64_t>(std::clamp(number.value_or(-1), -1.0, 1e15));
  if (sets == std::string::npos && ignores_repetitions && (at == last || at == last - 1)) return {};
  if (sets == std::string::npos && at != last + 1)
    return {{}, complaint("Line Number is not Last Line Number+1")};
  if (star == std::string::npos) return {{}, complaint("No Checksum with line number")};
  if (parameter(" " + line.substr(star), "*") != marlin_checksum(line.substr(0, star)))
    return {{}, complaint("checksum mismatch")};
  last = at;
  const std::size_t first = space < star ? space + 1 : 1;
  return {line.substr(first, star - first), {}};
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

double PlainRig::next_event() const { return std::min(next_frame(), held_until_s_.value_or(next_frame())); }

void PlainRig::advance(double t) {
  for (double next = next_event(); next <= t; next = next_event()) {
    now_s_ = std::max(now_s_, next);
    if (held_until_s_ && *held_until_s_ <= next) {
      held_until_s_.reset();
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
  const auto [command, complaint] = lines_.take(line);
  output_ += complaint;
  if (!command || command->empty()) return;
  const std::string code = code_of(*command);
  if (code == "M410") {  // acts ahead of the queue, and holds what comes behind it
    motion_.stop(now_s_);
    if (held_until_s_) held_until_s_ = now_s_;
  }
  if (code == "M112") {
    motion_.stop(now_s_);
    output_ += "echo:M112 Shutdown\nError:Printer halted. kill() called!\n";
    halted_ = true;
    return;
  }
  waiting_.push_back(*command);
  run_waiting();
}

void PlainRig::run_waiting() {
  while (!held_until_s_ && !waiting_.empty()) {
    const std::string command = waiting_.front();
    waiting_.pop_front();
    output_ += answer_to(command);
    if (!held_until_s_) output_ += "ok\n";
  }
}

std::string PlainRig::answer_to(const std::string& command) {
  const std::string code = code_of(command);
  if (code == "G0" || code == "G1") {
    move(command);
  } else if (code == "G92") {
    const Point3 at = motion_.target(), named = place_in(command);
    zero_ = {at.x - named.x, at.y - named.y, at.z - named.z};
  } else if (code == "M114") {
    const Point3 p = command.ends_with("R") ? motion_.at(now_s_) : motion_.target();
    return "X:" + format(p.x - zero_.x, 2) + " Y:" + format(p.y - zero_.y, 2) +
           " Z:" + format(p.z - zero_.z, 2) + " E:0.00 Count X:0 Y:0 Z:0\n";
  } else if (code == "M105") {
    return " T:25.00 /0.00 B:25.00 /0.00 @:0 B@:0\n";
  } else if (code == "M115") {
    return "FIRMWARE_NAME:Marlin 2.1.2 (virtual rig) PROTOCOL_VERSION:1.0\nCap:EMERGENCY_PARSER:1\n";
  } else if (code == "G28" || code == "M400" || code == "M410") {
    if (code == "G28") motion_.home(now_s_), zero_ = {};
    held_until_s_ = code == "M410" ? now_s_ + kStopHoldsS : std::max(now_s_, motion_.end_time());
  } else if (code != "M110" && code != "M108") {
    return "echo:Unknown command: \"" + command + "\"\n";
  }
  return {};
}

// Where it leads to, or is to be called, in the coordinates of commands.
Point3 PlainRig::place_in(const std::string& command) const {
  const Point3 at = motion_.target();
  return {parameter(command, "X").value_or(at.x - zero_.x), parameter(command, "Y").value_or(at.y - zero_.y),
          parameter(command, "Z").value_or(at.z - zero_.z)};
}

void PlainRig::move(const std::string& command) {
  if (const auto feed = parameter(command, "F")) feed_mm_s_ = *feed / 60;
  const Point3 to = place_in(command);
  motion_.move_to({to.x + zero_.x, to.y + zero_.y, to.z + zero_.z}, feed_mm_s_, now_s_);
}

std::vector<std::byte> PlainRig::from_printer() {
  const std::string sent = std::exchange(output_, {});
  const auto bytes = std::as_bytes(std::span(sent));
  return {bytes.begin(), bytes.end()};
}

PseudoTerminal::PseudoTerminal(const std::string& link) : link_(link) {
  master_ = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
  if (master_ < 0 || grantpt(master_) != 0 || unlockpt(master_) != 0) failed("cannot open a pseudo-terminal");
  std::array<char, 128> name{};
  if (ptsname_r(master_, name.data(), name.size()) != 0) failed("cannot name a pseudo-terminal");
  slave_ = name.data();
  // Held open so that the master does not see a hang-up between two programs; raw, so that nothing is echoed.
  keep_open_ = open(slave_.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
  if (keep_open_ < 0) failed("cannot open " + slave_);
  if (set_raw_terminal(keep_open_, rig::kPrinterBaud) != 0) failed("cannot configure " + slave_);
  link_at(slave_, link_);
}

PseudoTerminal::~PseudoTerminal() {
  unplug();
  unlink(link_.c_str());
}

void PseudoTerminal::unplug() {
  if (keep_open_ >= 0) close(keep_open_);
  if (master_ >= 0) close(master_);
  keep_open_ = master_ = -1;
}

double PtyRig::now(double speedup) { return monotonic_seconds() * speedup; }

PtyRig::PtyRig(std::unique_ptr<RigAtPorts> rig, const std::string& board_link,
               const std::string& printer_link, double speedup)
    : board_(board_link), printer_(printer_link), rig_(std::move(rig)), speedup_(speedup) {
  rig_->board_sink = [this](std::span<const std::byte> bytes, double) { return send_frame(bytes); };
  thread_ = std::thread([this] { run(); });
}

PtyRig::~PtyRig() {
  stop_ = true;
  thread_.join();
}

void PtyRig::run() {
  while (!stop_) {
    pollfd printer{-1, POLLIN, 0};
    timespec wait{0, 0};
    {
      std::lock_guard lock(mutex_);
      serve_printer();
      const double next = std::clamp((rig_->next_event() / speedup_) - monotonic_seconds(), 1e-4, 0.01);
      wait.tv_nsec = static_cast<long>(1e9 * next);
      printer.fd = printer_.descriptor();
    }
    ppoll(&printer, 1, &wait, nullptr);
  }
}

void PtyRig::serve_printer() {
  rig_->advance(now(speedup_));
  if (printer_.descriptor() < 0) return;
  std::array<std::byte, 1024> buffer{};
  const ssize_t count = ::read(printer_.descriptor(), buffer.data(), buffer.size());
  if (count > 0) rig_->to_printer(std::span(buffer).first(static_cast<std::size_t>(count)));
  const std::vector<std::byte> fresh = rig_->from_printer();
  printer_out_.insert(printer_out_.end(), fresh.begin(), fresh.end());
  if (printer_out_.empty()) return;
  const ssize_t sent = ::write(printer_.descriptor(), printer_out_.data(), printer_out_.size());
  if (sent > 0) printer_out_.erase(printer_out_.begin(), printer_out_.begin() + sent);
  if (printer_out_.size() > 65536) printer_out_.clear();  // nobody listens
}

// When the terminal is full (4095 bytes, 24.8 ms) a frame vanishes; one that went in half is completed by
// nothing, as on a stalled USB line.
std::size_t PtyRig::send_frame(std::span<const std::byte> bytes) {
  if (board_.descriptor() < 0) return bytes.size();
  return static_cast<std::size_t>(
      std::max<ssize_t>(0, ::write(board_.descriptor(), bytes.data(), bytes.size())));
}

}  // namespace supertac
