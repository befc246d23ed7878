#include "data/frames/board_frame.h"

#include <cstdlib>
#include <stdexcept>
#include <string>

namespace supertac {

std::array<float, rig::kTaxels> taxel_volts(const BoardFrame& frame) {
  std::array<float, rig::kTaxels> volts{};
  for (int k = 0; k < rig::kTaxels; ++k)
    volts[static_cast<std::size_t>(k)] =
        static_cast<float>(frame.taxel(k)) * static_cast<float>(rig::kAdcVolts / rig::kAdcCodes);
  return volts;
}

bool is_frame(const std::byte* bytes) {
  if (bytes[0] != kFrameHeader || bytes[rig::kFrameBytes - 1] != kFrameTrailer) return false;
  for (std::size_t at = 1; at < rig::kFrameBytes - 1; at += 2)  // the high bytes
    if ((bytes[at] & std::byte{0xF0}) != std::byte{0}) return false;
  return true;
}

BoardFrame parse_frame(const std::byte* bytes) {
  const auto sample = [bytes](std::size_t at) {
    return static_cast<std::uint16_t>(std::to_integer<unsigned>(bytes[at]) << 8 |
                                      std::to_integer<unsigned>(bytes[at + 1]));
  };
  BoardFrame frame;
  for (std::size_t n = 0; n < rig::kFrameSamples; ++n) frame.samples[n] = sample(1 + 2 * n);
  frame.slip = sample(161);
  return frame;
}

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

std::uint32_t damaged_frames(std::uint64_t discarded) {
  return static_cast<std::uint32_t>((discarded + rig::kFrameBytes - 1 - 8) / rig::kFrameBytes);
}

bool JumpDetector::jump(const BoardFrame& frame) {
  bool far = false;
  for (int k = 0; k < rig::kTaxels && !first_; ++k) {
    far = far || std::abs(frame.taxel(k) - last_[static_cast<std::size_t>(k)]) > 124;
  }
  first_ = false;
  // Three in a row are a change of the world, not of a byte.
  const bool flag = far && flagged_ < 3;
  flagged_ = flag ? flagged_ + 1 : 0;
  if (!flag) {
    for (int k = 0; k < rig::kTaxels; ++k) last_[static_cast<std::size_t>(k)] = frame.taxel(k);
  }
  return flag;
}

BoardDecoder::BoardDecoder()
    : BinaryDecoder({.kind = FrameKind::binary,
                     .header = {std::to_integer<char>(kFrameHeader)},
                     .trailer = {std::to_integer<char>(kFrameTrailer)},
                     .fields = {{.is = FrameField::Is::skip, .count = rig::kFrameBytes - 2}}},
                    0, true) {}

void BoardDecoder::hand_over(const std::byte* start, const Sink& sink) {
  frame_ = parse_frame(start);
  const auto volts = taxel_volts(frame_);
  ++counters_.frames;
  sink({.values = volts,
        .time_s = std::nullopt,
        .damaged = damaged_frames(discarded()),
        .suspect = discarded() > 0,
        .jump = jumps_.jump(frame_)});
}

}  // namespace supertac
