// The virtual rig behind two in-memory ports, in simulated time: waiting on the printer's port makes the time
// pass. A whole collection takes a second and is the same in every run, on however loaded a machine.
#pragma once

#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <vector>

#include "hardware/ports/port.h"
#include "tests/hardware/virtual_rig/rig_world.h"

namespace supertac {

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
  std::vector<std::byte> printer_bytes_;
  Dice latency_, freezes_;
  double freeze_rate_, frozen_until_ = 0;
  std::size_t room_ = 0;  // in the kernel's buffers while the host stands still
  double board_time_ = 0;
  bool board_listens_ = false, board_gone_ = false, printer_gone_ = false;
  RigWorld world_;
};

}  // namespace supertac
