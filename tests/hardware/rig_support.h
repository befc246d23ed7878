// What several tests of the hardware need: a scratch folder, frames that differ, a printer in simulated time.
#pragma once

#include <stdlib.h>

#include <filesystem>
#include <string>
#include <vector>

#include "hardware/board_frame.h"
#include "hardware/virtual_rig/simulated_rig.h"
#include "io/random.h"

namespace supertac {

class ScratchFolder {
 public:
  ScratchFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "supertac-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("no scratch folder");
    path_ = name;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

inline BoardFrame random_frame(std::uint64_t index, std::uint64_t seed = 7) {
  const RandomStream random(seed, index);
  BoardFrame frame;
  for (std::size_t n = 0; n < kFrameSamples; ++n) frame.samples[n] = random.bits(n) & 0xFFF;
  frame.slip = random.bits(99) & 0xFFF;
  return frame;
}

inline std::vector<std::byte> frame_bytes(const BoardFrame& frame) {
  std::vector<std::byte> bytes(kFrameBytes);
  write_frame(frame, std::span<std::byte, kFrameBytes>(bytes));
  return bytes;
}

/// A rig without faults whose firmware is already running.
inline RigSettings running_rig() {
  RigSettings settings;
  settings.printer_running = true;
  return settings;
}

/// Motion commands among those that ran.
inline std::vector<std::string> moves_of(const VirtualPrinter& printer) {
  std::vector<std::string> moves;
  for (const auto& executed : printer.executed()) {
    if (executed.command.starts_with("G1")) moves.push_back(executed.command);
  }
  return moves;
}

}  // namespace supertac
