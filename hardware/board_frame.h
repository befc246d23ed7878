// One frame of the tactile board, to the byte. 164 bytes: 0x24, 80 big-endian samples, one auxiliary (slip)
// sample, 0x21; no length, no counter, no checksum. The ADC has 12 bits, so all 81 high bytes are <= 0x0F.
// Sample n: patch = n % 5, row = (n % 20) / 5, column = n / 20. The rig's finger is patch 0.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace supertac {

constexpr std::size_t kFrameBytes = 164;
constexpr int kFrameSamples = 80;
constexpr int kBoardTaxels = 16;
constexpr std::byte kFrameHeader{0x24};
constexpr std::byte kFrameTrailer{0x21};
constexpr std::uint16_t kAdcMax = 4095;
/// 16 ticks of 62 us: 1008.06 frames a second.
constexpr double kTickSeconds = 62e-6;
constexpr double kFramePeriod = 16 * kTickSeconds;
constexpr unsigned kBoardBaud = 7'372'800;

struct BoardFrame {
  std::array<std::uint16_t, kFrameSamples> samples{};
  std::uint16_t slip = 0;
  bool operator==(const BoardFrame&) const = default;

  /// ADC value of taxel k = 4 column + row of patch 0, which is sample 5 k.
  std::uint16_t taxel(int k) const { return samples[static_cast<std::size_t>(5 * k)]; }
};

/// V = adc * 3.3 / 4096.
constexpr float adc_to_volts(std::uint16_t adc) { return static_cast<float>(adc) * (3.3F / 4096.0F); }

/// Nearest ADC value, saturating at 0 and 4095.
std::uint16_t volts_to_adc(double volts);

/// The 16 taxels in volts, k fastest.
std::array<float, kBoardTaxels> taxel_volts(const BoardFrame& frame);

/// True when `bytes` (at least 164) starts with a header, 81 high bytes <= 0x0F and a trailer.
bool is_frame(const std::byte* bytes);

/// The frame at `bytes`; is_frame(bytes) must hold.
BoardFrame parse_frame(const std::byte* bytes);

/// Writes the 164 bytes of `frame`. Throws std::invalid_argument for a sample above 4095.
void write_frame(const BoardFrame& frame, std::span<std::byte, kFrameBytes> out);

}  // namespace supertac
