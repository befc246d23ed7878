// One frame of the tactile board, to the byte. 164 bytes: 0x24, 80 big-endian samples, one auxiliary (slip)
// sample, 0x21; no length, no counter, no checksum. The ADC has 12 bits, so all 81 high bytes are <= 0x0F.
// Sample n belongs to patch n % 5 and taxel k = n / 5; the rig's finger is patch 0. Here as in data/, taxel k
// lies in row k / 4 (along y) and column k % 4 (along x). The board's firmware names them the other way
// round: it scans "columns", which are our rows.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "data/frames/binary_decoder.h"
#include "data/sensors/rig.h"

namespace supertac {

constexpr std::byte kFrameHeader{0x24};
constexpr std::byte kFrameTrailer{0x21};

struct BoardFrame {
  std::array<std::uint16_t, rig::kFrameSamples> samples{};
  std::uint16_t slip = 0;
  bool operator==(const BoardFrame&) const = default;

  /// ADC value of the finger's taxel k.
  std::uint16_t taxel(int k) const {
    return samples[std::size_t{rig::kPatches} * static_cast<std::size_t>(k)];
  }
};

/// The finger's taxels in volts, rig::volts_of() in single precision.
std::array<float, rig::kTaxels> taxel_volts(const BoardFrame& frame);

/// True when `bytes` (at least 164) starts with a header, 81 high bytes <= 0x0F and a trailer.
bool is_frame(const std::byte* bytes);

/// The frame at `bytes`; is_frame(bytes) must hold.
BoardFrame parse_frame(const std::byte* bytes);

/// Writes the 164 bytes of `frame`. Throws std::invalid_argument for a sample above 4095.
void write_frame(const BoardFrame& frame, std::span<std::byte, rig::kFrameBytes> out);

/// How many frames the `discarded` bytes between two whole frames were. A byte or two too many or too few are
/// a cable's errors.
std::uint32_t damaged_frames(std::uint64_t discarded);

/// Flags physically implausible jumps: a taxel that moves more than 124 ADC steps, 0.1 V, between two frames,
/// in which the finger moves 0.01 mm at 10 mm/s. A flipped bit in a sample passes every check of the format;
/// only this can show it.
class JumpDetector {
 public:
  bool jump(const BoardFrame& frame);

 private:
  std::array<int, rig::kTaxels> last_{};
  int flagged_ = 0;
  bool first_ = true;
};

/// Finds the board's frames in its byte stream. On a failed check it looks again from the NEXT BYTE: at 1e-3
/// dropped bytes a reader that skips whole frames loses 16-87 % of the undamaged ones, this one none. A
/// flipped bit inside a sample cannot be detected, the format has no checksum: see JumpDetector.
class BoardDecoder : public BinaryDecoder {
 public:
  BoardDecoder();
  /// The one that was handed over last.
  const BoardFrame& frame() const { return frame_; }

 private:
  bool is_frame(const std::byte* start) const override { return supertac::is_frame(start); }
  void hand_over(const std::byte* start, const Sink& sink) override;

  BoardFrame frame_;
  JumpDetector jumps_;
};

}  // namespace supertac
