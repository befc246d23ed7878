// Loops of int8 networks over numbers of 16 bits, for the few maps that bytes would be too coarse for. clip()
// without bounds is to -32768 .. 32767.
#pragma once

#include "autograd/kernels/fast/int8/int8.h"

namespace supertac::kernels {

/// ByteProductJob with numbers: y[pixel, o] = clip of the outcome of the sum over segments, k of
/// x[pixel + segment + k] * w[segment, k, o], w [segment_count][length][cout]. The sum is exact in 32 bits,
/// its product with the multiplier in 64; the result is clipped to 16 before the slope.
void product_of_numbers(const ByteProductJob& job, const std::int16_t* x, std::int16_t* y);

/// y [channels] = the mean over height x width pixels of x, whose lines are `line` apart, halves away from 0.
void means(Dim height, Dim width, Dim channels, Dim line, const std::int16_t* x, std::int16_t* y);

/// y = clip(((x * multiplier + offset) >> shift) + zero, 0, 255) for n numbers.
void to_bytes(Dim n, const std::int16_t* x, std::int32_t multiplier, std::int32_t offset, std::int32_t shift,
              std::int32_t zero, std::uint8_t* y);
/// y = clip(round(x * per_step)), halves upwards.
void to_numbers(Dim n, const float* x, float per_step, std::int16_t* y);
/// y = clip(a + (x * gate + 2048 >> 12)) for n pixels of so many channels, one gate a channel; clip(a + x)
/// where gates is null.
void gated_sum(Dim pixels, Dim channels, const std::int16_t* a, const std::int16_t* x,
               const std::int16_t* gates, std::int16_t* y);
inline constexpr std::int32_t kGateBits = 12;
/// gate = sigmoid(x * step), in 4096ths.
void gates(Dim n, const std::int16_t* x, float step, std::int16_t* y);

}  // namespace supertac::kernels
