// A rig that misbehaves by seed: printer and board in one world, the board feeling what is under the
// printer's head. FaultyPtyRig drives it in (sped-up) real time, simulated_rig.h in simulated time.
#pragma once

#include <string>

#include "hardware/virtual_rig/virtual_rig.h"
#include "tests/hardware/virtual_rig/virtual_board.h"
#include "tests/hardware/virtual_rig/virtual_printer.h"

namespace supertac {

struct RigSettings {
  VirtualPrinterSettings printer{};
  VirtualBoardSettings board{};
  bool printer_running = false;  ///< booted long ago
  RigFaults faults{};            ///< replaces those of printer and board
  double chunk_s = 0;      ///< longest wait of an adapter that hands the board's bytes on in chunks; 0: none
  std::size_t memory = 0;  ///< bytes that this adapter keeps of what the host does not take
  std::uint64_t seed = 1;  ///< replaces those of printer and board
};

class RigWorld : public RigAtPorts {
 public:
  RigWorld(const RigSettings& settings, double t);

  void advance(double t) override;
  double next_event() const override;
  void to_printer(std::span<const std::byte> bytes) override;
  std::vector<std::byte> from_printer() override;
  bool printer_unplugged() const override { return printer_.unplugged(); }

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
  void unplug_printer() {
    const std::lock_guard lock(mutex_);
    printer_.unplug();
  }
};

}  // namespace supertac
