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

struct BoardFrame {
  std::array<std::uint16_t, rig::kFrameSamples> samples{};
  std::uint16_t slip = 0;
  bool operator==(const BoardFrame&) const = default;

  /// ADC value of the finger's taxel k.
  std::uint16_t taxel(int k) const {
    return samples[std::size_t{rig::kPatches} * static_cast<std::size_t>(k)];
  }
};

/// Writes the 164 bytes of `frame`. Throws std::invalid_argument for a sample above 4095.
void write_frame(const BoardFrame& frame, std::span<std::byte, rig::kFrameBytes> out);

/// Finds the board's frames in its byte stream: a header, 81 high bytes <= 0x0F and a trailer. On a failed
/// check it looks again from the NEXT BYTE: at 1e-3 dropped bytes a reader that skips whole frames loses
/// 16-87 % of the undamaged ones, this one none. Values are the finger's taxels in volts, rig::volts_of() in
/// single precision. Bytes between two whole frames count as damaged frames; a byte or two too many or too
/// few are a cable's errors.
///
/// A flipped bit inside a sample passes every check of the format. DecodedFrame::jump flags a taxel that
/// moves more than 124 ADC steps, 0.1 V, between two frames, in which the finger moves 0.01 mm at 10 mm/s;
/// three such frames in a row are a change of the world.
class BoardDecoder : public BinaryDecoder {
 public:
  BoardDecoder();
  /// The one that was handed over last.
  const BoardFrame& frame() const { return frame_; }

 private:
  bool is_frame(const std::byte* start) const override;
  void hand_over(const std::byte* start, const Sink& sink) override;
  bool jumps();

  BoardFrame frame_;
  std::array<int, rig::kTaxels> before_{};  // the taxels of the last frame that was no jump
  int jumps_ = 0;                           // frames in a row that were
  bool first_ = true;
};

}  // namespace supertac
