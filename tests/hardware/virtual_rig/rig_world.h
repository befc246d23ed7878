// A rig that misbehaves by seed: printer and board in one world, the board feeling what is under the
// printer's head. FaultyPtyRig drives it in (sped-up) real time, SimulatedRig in simulated time.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tests/hardware/virtual_rig/virtual_printer.h"

namespace supertac {

/// A tactile board: true byte format and rate, frames that vanish when USB is busy, and after a stall a torn
/// one.
class VirtualBoard {
 public:
  /// What happened to the frames; made = sent + lost, torn ones are among the sent.
  struct Counters {
    std::uint64_t made = 0, sent = 0, lost = 0, torn = 0;
  };

  /// Of the faults lost frames and stalls; bytes are the port's matter.
  VirtualBoard(FingerSignals signals, const RigFaults& faults, std::uint64_t seed, double t);

  /// End of the frame now being sampled.
  double next_frame() const { return start_ + static_cast<double>(counters_.made + 1) * rig::kFramePeriodS; }
  /// Finishes the frame that ends at next_frame(); `head` is where the finger was in its middle.
  /// Returns the bytes to send, empty when the frame vanished.
  std::vector<std::byte> make_frame(const Point3& head);
  /// The host did not take the bytes: the frame vanishes, and the one after the stall is torn.
  void refuse_last();

  /// Called with the head's place for every frame that is made, lost ones too.
  void on_frame(std::function<void(const Point3& head)> truth) { truth_ = std::move(truth); }
  const Counters& counters() const { return counters_; }

 private:
  FingerSignals signals_;
  RigFaults faults_;
  double start_;
  Dice dice_;
  Counters counters_;
  std::function<void(const Point3&)> truth_;
  BoardFrame previous_;
  int stalled_frames_ = 0, room_ = 0;
  std::vector<std::byte> held_;  // made in a freeze, to be sent at its end
  bool tear_next_ = false;
};

struct RigSettings {
  VirtualPrinterSettings printer{};
  FingerSignals signals{};       ///< of the board; empty: all taxels at rest
  bool printer_running = false;  ///< booted long ago
  RigFaults faults{};
  double chunk_s = 0;      ///< longest wait of an adapter that hands the board's bytes on in chunks; 0: none
  std::size_t memory = 0;  ///< bytes that this adapter keeps of what the host does not take
  std::uint64_t seed = 1;
};

class RigWorld : public RigAtPorts {
 public:
  RigWorld(const RigSettings& settings, double t);

  void advance(double t) override;
  double next_event() const override;
  void to_printer(std::span<const std::byte> bytes) override;
  std::vector<std::byte> from_printer() override;

  double now() const { return now_; }
  VirtualPrinter& printer() { return printer_; }
  VirtualBoard& board() { return board_; }

 private:
  void hand_on(double t);

  double now_;
  VirtualPrinter printer_;
  VirtualBoard board_;
  double chunk_s_, chunk_due_;
  std::size_t memory_;
  Dice chunk_dice_;
  std::vector<std::byte> chunk_;  // of an adapter
  ByteFaults to_printer_bytes_, from_printer_bytes_, board_bytes_;
};

class FaultyPtyRig : public PtyRig {
 public:
  FaultyPtyRig(const RigSettings& settings, const std::string& board_link, const std::string& printer_link,
               double speedup = 1)
      : PtyRig(std::make_unique<RigWorld>(settings, now(speedup)), board_link, printer_link, speedup) {}
  /// Runs `action` with the rig held still.
  void with_world(const std::function<void(RigWorld&)>& action) {
    const std::lock_guard lock(mutex_);
    action(dynamic_cast<RigWorld&>(*rig_));
  }
  void unplug_board() {
    const std::lock_guard lock(mutex_);
    board_.unplug();
  }
};

}  // namespace supertac
