// Faults of a cable, by seed: the n-th byte of a stream meets the same fate in every run.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "io/numbers/random.h"

namespace supertac {

/// Rates of everything that can go wrong around the virtual rig. All 0: a perfect rig.
struct RigFaults {
  double byte_rate = 0;     ///< per byte and direction: dropped, flipped (one bit) or inserted, a third each
  double lost_ok_rate = 0;  ///< per ok
  double resend_storm_rate = 0;  ///< per line: the firmware complains several times about a good line
  double reset_rate = 0;         ///< per line: the firmware restarts
  double action_rate = 0;        ///< per line: the display says //action:cancel or its like
  double pause_rate = 0;         ///< per line: it waits for its user when the move has ended
  double stall_rate =
      0;  ///< per line: the firmware answers 50 ms late; per frame: the board sends 20 ms late
  double freeze_rate = 0;       ///< per line and per frame: 0.3 to 2 s without motion and answers, or frames
  double lost_frame_rate = 0;   ///< per frame: USB was busy, the frame vanishes
  double host_freeze_rate = 0;  ///< per call of the printer's port: the host stands still for 0.1 to 2 s
};

/// A stream of decisions.
class Dice {
 public:
  Dice(std::uint64_t seed, std::uint64_t stream) : random_(seed, stream) {}
  /// True with probability `rate`.
  bool hit(double rate) { return rate > 0 && random_.uniform(counter_++) < rate; }
  double uniform() { return random_.uniform(counter_++); }
  std::uint32_t below(std::uint32_t limit) { return random_.bits(counter_++) % limit; }

 private:
  RandomStream random_;
  std::uint64_t counter_ = 0;
};

/// Drops, flips and inserts bytes.
class ByteFaults {
 public:
  ByteFaults(double rate, std::uint64_t seed, std::uint64_t stream) : rate_(rate), dice_(seed, stream) {}
  std::vector<std::byte> apply(std::span<const std::byte> bytes) {
    if (!(rate_ > 0)) return {bytes.begin(), bytes.end()};
    std::vector<std::byte> out;
    out.reserve(bytes.size() + 8);
    for (const std::byte byte : bytes) {
      if (!dice_.hit(rate_)) {
        out.push_back(byte);
        continue;
      }
      switch (dice_.below(3)) {
        case 0:
          break;
        case 1:
          out.push_back(byte ^ static_cast<std::byte>(1U << dice_.below(8)));
          break;
        default:
          out.push_back(byte);
          out.push_back(static_cast<std::byte>(dice_.below(256)));
      }
    }
    return out;
  }

 private:
  double rate_;
  Dice dice_;
};

}  // namespace supertac
