// What several tests of the hardware need: a rig in simulated time, a connected printer on it, frames that
// differ.
#pragma once

#include <stdlib.h>

#include <algorithm>
#include <array>
#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "data/frames/binary_decoder.h"
#include "hardware/collection/collection.h"
#include "hardware/printers/printer.h"
#include "io/numbers/random.h"
#include "tests/hardware/fake_port.h"
#include "tests/hardware/numbered_board.h"
#include "tests/hardware/virtual_rig/rig_world.h"
#include "tests/support/test.h"

namespace supertac {

/// The virtual rig behind two in-memory ports, in simulated time: waiting on the printer's port makes the
/// time pass. A whole collection takes a second and is the same in every run, on however loaded a machine.
class SimulatedRig {
 public:
  explicit SimulatedRig(const RigSettings& settings);
  ~SimulatedRig();
  SimulatedRig(const SimulatedRig&) = delete;
  SimulatedRig& operator=(const SimulatedRig&) = delete;

  /// The printer's port. Time passes while it waits and writes (at rig::kPrinterBaud).
  std::unique_ptr<Port> printer_port();
  /// The board's port: waits for real until simulated time has brought bytes. May be read by another thread.
  std::unique_ptr<Port> board_port();

  /// Lets simulated time pass.
  void run_for(double seconds);
  double now();
  /// Pulls the plug: from now on the port throws PortUnplugged, the board's after its last bytes.
  void unplug_board();
  void unplug_printer();

  /// The world itself; only between calls to the ports, from the thread that uses the printer's.
  RigWorld& world() { return world_; }

 private:
  class PrinterPort;
  class BoardPort;
  struct Chunk {
    double time_s;
    std::vector<std::byte> bytes;
  };
  std::size_t take_board_bytes(std::span<const std::byte> bytes, double t);
  std::size_t hold(std::span<const std::byte> bytes);
  void maybe_freeze(std::unique_lock<std::mutex>& lock);
  void advance(std::unique_lock<std::mutex>& lock, double t);

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Chunk> board_chunks_;
  Dice latency_, freezes_;
  double freeze_rate_, frozen_until_ = 0;
  std::size_t room_ = 0;  // in the kernel's buffers while the host stands still
  double board_time_ = 0;
  bool board_listens_ = false, board_gone_ = false, printer_gone_ = false;
  RigWorld world_;
};

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
  std::vector<std::string> moves = printer.executed();
  std::erase_if(moves, [](const std::string& command) { return !command.starts_with("G1"); });
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

/// A collection on a simulated rig, and what it is to do.
struct CollectionBench {
  explicit CollectionBench(const RigSettings& rig_settings, const PalpationPlan& plan = {},
                           const Point3& origin = rig::kMounted)
      : rig(rig_settings) {
    settings.bed.plan = plan, settings.bed.origin = origin;
    settings.journal = folder / "journal";
    settings.header = "test";
    settings.reader.queue_frames = 16;  // nobody looks at the live frames here
  }
  RecorderReport record() { return record_palpation(rig.board_port(), rig.printer_port(), settings); }
  Journal journal() const { return read_journal(settings.journal); }
  VirtualPrinter& firmware() { return rig.world().printer(); }
  Point3 head() { return firmware().head(rig.now()); }

  TemporaryFolder folder;
  SimulatedRig rig;
  RecorderSettings settings;
};

/// The same with the head at the origin, and frames that carry their number.
struct NumberedCollection {
  NumberedCollection(RigSettings rig_settings, const PalpationPlan& plan, const Point3& origin)
      : numbers((rig_settings.printer.head = origin, rig_settings)), bench(rig_settings, plan, origin) {
    numbers.watch(bench.rig.world().board());
  }
  NumberedBoard numbers;
  CollectionBench bench;
};

/// The same, and the head's place is known: rig::kMounted.
struct ReadyBench : PrinterBench {
  explicit ReadyBench(const RigSettings& settings = running_rig()) : PrinterBench(settings) {
    printer.confirm_origin(rig::kMounted);
  }
  /// A run of the plan; `plant` is done once, when the head is in the slide of pass 1.
  PalpationOutcome run(const PalpationPlan& plan, const std::function<void()>& plant) {
    bool done = false;
    PalpationObserver observer;
    observer.position = [&](const Leg& leg, const PositionSample& sample) {
      if (leg.phase == Phase::slide && sample.position.y >= 120 && !std::exchange(done, true)) plant();
    };
    return run_palpation(printer, plan, observer);
  }
};

}  // namespace supertac
