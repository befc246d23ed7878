// The virtual rig behind two pseudo-terminals, linked at the given paths: any program that talks to a serial
// port can talk to it, through the kernel's terminal driver as with the real thing.
#pragma once

#include <atomic>
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
  /// Runs at `speedup` times the wall clock until destroyed. `rig` begins at now(speedup).
  PtyRig(std::unique_ptr<RigAtPorts> rig, const std::string& board_link, const std::string& printer_link,
         double speedup = 1);
  static double now(double speedup);
  ~PtyRig();

 protected:
  std::mutex mutex_;  // of the rig and its ports
  PseudoTerminal board_, printer_;
  std::unique_ptr<RigAtPorts> rig_;

 private:
  void run();
  std::size_t send_frame(std::span<const std::byte> bytes);
  void serve_printer();

  double speedup_;
  std::vector<std::byte> printer_out_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace supertac
