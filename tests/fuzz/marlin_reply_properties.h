// What must hold for the Marlin link whatever the firmware answers.
#pragma once

#include <algorithm>
#include <span>
#include <stdexcept>
#include <string>

#include "hardware/printers/marlin_link.h"
#include "hardware/printers/printer.h"

namespace supertac {

/// A firmware whose answers are given: every write releases the text up to the next 0 byte. Time passes only
/// while the driver waits.
class ScriptedFirmware : public Port {
 public:
  ScriptedFirmware(std::string_view script, int polite) : script_(script), polite_(polite) {}
  const std::string& name() const override { return name_; }
  double now() override { return time_ += 1e-6; }
  Received read(std::span<std::byte> buffer, double until) override {
    if (answer_.empty()) {
      time_ = std::max(time_, until);
      return {0, time_};
    }
    const std::size_t count = std::min(buffer.size(), answer_.size());
    std::copy_n(std::as_bytes(std::span(answer_)).begin(), count, buffer.begin());
    answer_.erase(0, count);
    return {count, time_ += 1e-3};
  }
  double write(std::span<const std::byte> bytes, double) override {
    ++writes_;
    const std::string_view line(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    if (polite_ > 0) {
      --polite_;
      if (line.find("M115") != line.npos) answer_ += "FIRMWARE_NAME:Marlin\nCap:EMERGENCY_PARSER:0\n";
      answer_ += "ok\n";
      return time_ += 1e-3;
    }
    const std::size_t end = std::min(script_.find('\0'), script_.size());
    answer_ += script_.substr(0, end);
    script_.remove_prefix(std::min(end + 1, script_.size()));
    return time_ += 1e-3;
  }
  int writes() const { return writes_; }

 private:
  std::string name_ = "script";
  std::string_view script_;
  std::string answer_;
  double time_ = 1000;
  int polite_ = 0, writes_ = 0;
};

/// The first byte says how many writes are answered `ok` before the script begins. Whatever comes then, the
/// drivers end with a result or a typed error, in bounded time, and send nothing to a firmware that has
/// halted. Throws std::logic_error otherwise.
inline void check_marlin_replies(std::span<const std::byte> input) {
  if (input.empty()) return;
  const std::string_view script(reinterpret_cast<const char*>(input.data()) + 1, input.size() - 1);
  ScriptedFirmware port(script, std::to_integer<int>(input[0]) % 16);
  Printer printer(port);
  const double begin = port.now();
  try {
    printer.connect();
    printer.confirm_origin({100, 102, 131});
    printer.start_move({100, 102, 140}, 10);
    (void)printer.sample_position();
    printer.finish_move();
    (void)printer.quick_stop();
    printer.lift_out(135);
  } catch (const HardwareError&) {
  }
  if (printer.link().halted()) {
    const int writes = port.writes();
    try {
      printer.link().command("M114");
      throw std::logic_error("marlin link: a halted firmware took a command");
    } catch (const PrinterHalted&) {
    }
    if (port.writes() != writes) throw std::logic_error("marlin link: something was sent after the halt");
  }
  // A busy firmware may take its time: six seconds for every busy line.
  const double patience = 4000 + 6.0 * static_cast<double>(input.size());
  if (port.now() - begin > patience) throw std::logic_error("marlin link: it waited too long");
}

}  // namespace supertac
