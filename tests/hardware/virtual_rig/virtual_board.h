// A tactile board: true byte format and rate, frames that vanish when USB is busy, and after a stall a
// torn one.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "hardware/virtual_rig/virtual_rig.h"
#include "tests/hardware/virtual_rig/faults.h"

namespace supertac {

struct VirtualBoardSettings {
  FingerSignals signals{};               ///< empty: all taxels at rest
  double period_s = rig::kFramePeriodS;  ///< the board's own crystal
  RigFaults faults{};                    ///< lost frames and stalls; bytes are the port's matter
  std::uint64_t seed = 1;
};

class VirtualBoard {
 public:
  /// What happened to the frames; made = sent + lost, torn ones are among the sent.
  struct Counters {
    std::uint64_t made = 0, sent = 0, lost = 0, torn = 0;
  };

  VirtualBoard(const VirtualBoardSettings& settings, double t);

  /// End of the frame now being sampled.
  double next_frame() const { return start_ + static_cast<double>(counters_.made + 1) * settings_.period_s; }
  double period() const { return settings_.period_s; }
  /// Finishes the frame that ends at next_frame(); `head` is where the finger was in its middle.
  /// Returns the bytes to send, empty when the frame vanished.
  std::vector<std::byte> make_frame(const Point3& head);
  /// The host did not take the bytes: the frame vanishes, and the one after the stall is torn.
  void refuse_last();

  /// Called with the head's place for every frame that is made, lost ones too.
  void on_frame(std::function<void(const Point3& head)> truth) { truth_ = std::move(truth); }
  const Counters& counters() const { return counters_; }

 private:
  BoardFrame sample(const Point3& head, double t);

  VirtualBoardSettings settings_;
  double start_;
  Dice dice_;
  Counters counters_;
  std::function<void(const Point3&)> truth_;
  BoardFrame previous_;
  int stalled_frames_ = 0, room_ = 0;
  std::vector<std::byte> held_;  // made in a freeze, to be sent at its end
  bool tear_next_ = false;
};

}  // namespace supertac
