// The virtual rig behind two pseudo-terminals, linked at the given paths: any program that talks to a serial
// port can talk to it, through the kernel's terminal driver as with the real thing.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "hardware/virtual_rig/virtual_rig.h"

namespace supertac {

/// The master side of a pseudo-terminal, its slave side linked at `link`.
class PseudoTerminal {
 public:
  /// An existing symbolic link at `link` is replaced, anything else is refused. Throws PortError.
  explicit PseudoTerminal(const std::string& link);
  ~PseudoTerminal();
  PseudoTerminal(const PseudoTerminal&) = delete;
  PseudoTerminal& operator=(const PseudoTerminal&) = delete;

  int descriptor() const { return master_; }
  const std::string& path() const { return slave_; }
  /// Pulls the plug: the other side sees end of file.
  void unplug();

 private:
  std::string link_, slave_;
  int master_ = -1, keep_open_ = -1;
};

class PtyRig {
 public:
  /// Runs at `speedup` times the wall clock until destroyed. `rig` begins at now(speedup). `adapter`: between
  /// board and host stands one with a memory of its own.
  PtyRig(std::unique_ptr<RigAtPorts> rig, const std::string& board_link, const std::string& printer_link,
         double speedup = 1, bool adapter = false);
  static double now(double speedup);
  ~PtyRig();

  void unplug_board();
  void unplug_printer();
  /// Runs `action` with the rig held still.
  void with_rig(const std::function<void(RigAtPorts&)>& action);

 private:
  void run();
  bool send_frame(std::span<const std::byte> bytes);
  void serve_printer();
  void serve_adapter();

  double speedup_;
  bool adapter_;
  std::mutex mutex_;
  PseudoTerminal board_, printer_;
  std::unique_ptr<RigAtPorts> rig_;
  std::vector<std::byte> printer_out_, board_out_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace supertac
