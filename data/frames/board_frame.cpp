#include "data/frames/board_frame.h"

#include <cstdlib>
#include <stdexcept>
#include <string>

namespace supertac {

namespace {

constexpr std::byte kFrameHeader{0x24}, kFrameTrailer{0x21};

BoardFrame parse_frame(const std::byte* bytes) {
  const auto sample = [bytes](std::size_t at) {
    return static_cast<std::uint16_t>(bits_at(bytes + at, 2, true));
  };
  BoardFrame frame;
  for (std::size_t n = 0; n < rig::kFrameSamples; ++n) frame.samples[n] = sample(1 + 2 * n);
  frame.slip = sample(161);
  return frame;
}

}  // namespace

void write_frame(const BoardFrame& frame, std::span<std::byte, rig::kFrameBytes> out) {
  const auto put = [&out](std::size_t at, std::uint16_t value) {
    if (value >= rig::kAdcCodes) {
      throw std::invalid_argument("write_frame: sample " + std::to_string(value) + ", expected at most " +
                                  std::to_string(rig::kAdcCodes - 1));
    }
    out[at] = static_cast<std::byte>(value >> 8);
    out[at + 1] = static_cast<std::byte>(value & 0xFF);
  };
  out[0] = kFrameHeader;
  for (std::size_t n = 0; n < rig::kFrameSamples; ++n) put(1 + 2 * n, frame.samples[n]);
  put(161, frame.slip);
  out[rig::kFrameBytes - 1] = kFrameTrailer;
}

BoardDecoder::BoardDecoder()
    : BinaryDecoder({.kind = FrameKind::binary,
                     .header = {std::to_integer<char>(kFrameHeader)},
                     .trailer = {std::to_integer<char>(kFrameTrailer)},
                     .fields = {{.is = FrameField::Is::skip, .count = rig::kFrameBytes - 2}}},
                    0, true) {}

bool BoardDecoder::is_frame(const std::byte* start) const {
  if (start[0] != kFrameHeader || start[rig::kFrameBytes - 1] != kFrameTrailer) return false;
  for (std::size_t at = 1; at < rig::kFrameBytes - 1; at += 2)  // the high bytes
    if ((start[at] & std::byte{0xF0}) != std::byte{0}) return false;
  return true;
}

bool BoardDecoder::jumps() {
  bool far = false;
  for (int k = 0; k < rig::kTaxels && !first_; ++k)
    far = far || std::abs(frame_.taxel(k) - before_[static_cast<std::size_t>(k)]) > 124;
  first_ = false;
  const bool jump = far && jumps_ < 3;
  jumps_ = jump ? jumps_ + 1 : 0;
  for (int k = 0; k < rig::kTaxels && !jump; ++k) before_[static_cast<std::size_t>(k)] = frame_.taxel(k);
  return jump;
}

void BoardDecoder::hand_over(const std::byte* start, const Sink& sink) {
  frame_ = parse_frame(start);
  std::array<float, rig::kTaxels> volts{};
  for (int k = 0; k < rig::kTaxels; ++k)
    volts[static_cast<std::size_t>(k)] =
        static_cast<float>(frame_.taxel(k)) * static_cast<float>(rig::kAdcVolts / rig::kAdcCodes);
  ++counters_.frames;
  sink({.values = volts,
        .time_s = std::nullopt,
        .damaged = static_cast<std::uint32_t>((discarded() + rig::kFrameBytes - 1 - 8) / rig::kFrameBytes),
        .suspect = discarded() > 0,
        .jump = jumps()});
}

}  // namespace supertac
