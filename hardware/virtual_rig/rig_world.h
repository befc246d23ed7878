// Printer and board of the virtual rig in one world with one time: the board feels what is under the
// printer's head. No threads and no clock: PtyRig drives it in (sped-up) real time, the tests'
// simulated_rig.h in simulated time.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "hardware/virtual_rig/virtual_board.h"
#include "hardware/virtual_rig/virtual_printer.h"

namespace supertac {

struct RigSettings {
  VirtualPrinterSettings printer{};
  VirtualBoardSettings board{};
  bool printer_running = false;  ///< booted long ago
  RigFaults faults{};            ///< replaces those of printer and board
  double chunk_s = 0;      ///< longest wait of an adapter that hands the board's bytes on in chunks; 0: none
  std::uint64_t seed = 1;  ///< replaces those of printer and board
};

class RigWorld {
 public:
  /// Takes a frame's bytes at time t; false when the host does not take them.
  using BoardSink = std::function<bool(std::span<const std::byte>, double t)>;

  RigWorld(const RigSettings& settings, double t, BoardSink sink);

  /// Runs printer and board until time t, in the order of their events.
  void advance(double t);
  double next_event() const;
  /// Bytes from the host to the printer, arriving now.
  void to_printer(std::span<const std::byte> bytes);
  /// Bytes that left the printer.
  std::vector<std::byte> from_printer();

  double now() const { return now_; }
  VirtualPrinter& printer() { return printer_; }
  VirtualBoard& board() { return board_; }

 private:
  void hand_on(double t);

  double now_;
  VirtualPrinter printer_;
  VirtualBoard board_;
  BoardSink sink_;
  double chunk_s_, chunk_due_;
  Dice chunk_dice_;
  std::vector<std::byte> chunk_;  // of an adapter
  ByteFaults to_printer_bytes_, from_printer_bytes_, board_bytes_;
};

}  // namespace supertac
