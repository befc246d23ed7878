// What several tests of the hardware need: a scratch folder, frames that differ, a printer in simulated time.
#pragma once

#include <stdlib.h>

#include <algorithm>
#include <array>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "data/frames/board_frame.h"
#include "hardware/collection/palpation_recorder.h"
#include "hardware/printers/printer.h"
#include "io/numbers/random.h"
#include "tests/hardware/fake_port.h"
#include "tests/hardware/simulated_rig.h"
#include "tests/support/test.h"

namespace supertac {

inline BoardFrame random_frame(std::uint64_t index, std::uint64_t seed = 7) {
  const RandomStream random(seed, index);
  BoardFrame frame;
  for (std::size_t n = 0; n < rig::kFrameSamples; ++n) frame.samples[n] = random.bits(n) & 0xFFF;
  frame.slip = random.bits(99) & 0xFFF;
  return frame;
}

inline std::vector<std::byte> frame_bytes(const BoardFrame& frame) {
  std::vector<std::byte> bytes(rig::kFrameBytes);
  write_frame(frame, std::span<std::byte, rig::kFrameBytes>(bytes));
  return bytes;
}

/// A rig whose firmware is already running; without faults unless given.
inline RigSettings running_rig(const VirtualPrinterSettings& printer = {}, const RigFaults& faults = {}) {
  return {.printer = printer, .printer_running = true, .faults = faults};
}

/// Damages the bytes from or to the printer once: the first occurrence of `find` becomes `replace`.
class Tampering : public WrappedPort {
 public:
  using WrappedPort::WrappedPort;
  Received read(std::span<std::byte> buffer, double until) override {
    if (said_.empty()) {
      std::array<std::byte, 1024> raw{};
      const Received got = inner_->read(raw, until);
      said_ = as_text(std::span(raw).first(got.count));
      tamper(said_, from_printer);
      now_ = got.time_s;
    }
    return hand_on(buffer);
  }
  double write(std::span<const std::byte> bytes, double until) override {
    std::string text = as_text(bytes);
    tamper(text, to_printer);
    return inner_->write(std::as_bytes(std::span(text)), until);
  }
  using Change = std::pair<std::string, std::string>;
  std::vector<Change> from_printer, to_printer;

 private:
  static void tamper(std::string& text, std::vector<Change>& changes) {
    if (changes.empty()) return;
    const std::size_t at = text.find(changes.front().first);
    if (at == std::string::npos) return;
    text.replace(at, changes.front().first.size(), changes.front().second);
    changes.erase(changes.begin());
  }
};

/// Motion commands among those that ran.
inline std::vector<std::string> moves_of(const VirtualPrinter& printer) {
  std::vector<std::string> moves;
  for (const auto& executed : printer.executed()) {
    if (executed.command.starts_with("G1")) moves.push_back(executed.command);
  }
  return moves;
}

/// A connected driver on a simulated rig, and where the head really is. `damaged`: of the printer's answers.
struct PrinterBench {
  explicit PrinterBench(const RigSettings& settings = running_rig(),
                        std::vector<Tampering::Change> damaged = {})
      : rig(settings), port(rig.printer_port()), printer(port) {
    port.from_printer = std::move(damaged);
    printer.connect();
  }
  VirtualPrinter& firmware() { return rig.world().printer(); }
  Point3 head() { return firmware().head(rig.now()); }
  SimulatedRig rig;
  Tampering port;
  Printer printer;
};

}  // namespace supertac
