// Products of bytes, for networks that are prepared with less than fp32
// (models/inference/prepared/prepared.h). Sums of integers are exact: every instruction set, and every order,
// gives the same bits.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "autograd/kernels/fast/inference.h"

namespace supertac::kernels {

/// How the sum s of output o becomes a value of the next map. Whole numbers throughout, so that a
/// microcontroller computes the same (models/files/c_code.h writes this formula):
///   v = (s * multiplier[o] + offset[o]) >> shift[o]
///   v = max(v, (v * negative_slope + 2048) >> 12)        unless negative_slope is kNoSlope
///   a byte:   clip(v + zero, 0, 255)
///   a number: clip(v, -32768, 32767)
/// Nothing overflows: the multipliers are chosen so (models/inference/prepared/quantise.h).
struct Outcome {
  const std::int32_t *multiplier = nullptr, *offset = nullptr, *shift = nullptr;  // [cout]
  std::int32_t negative_slope = kNoSlope;                                         // of 4096
  std::int32_t zero = 0;
  static constexpr std::int32_t kNoSlope = 4096, kSlopeBits = 12, kSlopeHalf = 2048;
};

/// Sixteen places of an image one behind the other, from.pixel bytes apart. Where lines follow each other,
/// places of the margin lie between those that are pixels.
struct BytePlaces {
  struct Pixel {
    std::int32_t place = 0, to = 0;  // of the sixteen; where its results go, from the first pixel's
  };
  std::int32_t x = 0;  // where they begin, from the first pixel
  std::int32_t count = 0;
  std::array<Pixel, 16> pixels = {};  // the first `count`
};

/// ProductJob with bytes: s[pixel, o] = sum over segments, k of x[pixel + segment + k] * w[segment, k, o].
/// Strides and segments of x are bytes. `length` is a multiple of kQuad and cout of kByteOutputs; neighbours
/// along k lie together: w [segment_count][length / kQuad][cout][kQuad].
struct ByteProductJob {
  Dim images = 1, height = 1, width = 1;
  Strides from, to;
  const Dim* segments = nullptr;
  Dim segment_count = 0, length = 0;
  const std::int8_t* w = nullptr;
  Dim cout = 0, kept = 0;  // the first `kept` of cout outputs are written
  Outcome outcome = {};
  const BytePlaces* places = nullptr;  // of an image, places_of()
  Dim place_count = 0;
  std::int16_t* scratch = nullptr;  // images * reach_of(job).count, for kernels that multiply wider numbers
};
inline constexpr Dim kQuad = 4, kByteOutputs = 16;

/// All places of an image, sixteen at a time, each pixel once: the last sixteen overlap those before where
/// the number is no multiple. Empty for fewer than sixteen, or where lines are no multiple of from.pixel
/// apart.
std::vector<BytePlaces> places_of(const ByteProductJob& job);

/// The bytes of an image that a job reads: from `before` bytes before x on.
struct ByteReach {
  Dim before = 0, count = 0;
};
ByteReach reach_of(const ByteProductJob& job);

/// A kernel of one instruction set. It writes numbers or bytes: the other pointer is null.
using ByteProduct = void (*)(const ByteProductJob& job, const std::uint8_t* x, std::int16_t* y,
                             std::uint8_t* bytes);

struct ByteKernels {
  ByteProduct product;
  bool beats_floats = false;  ///< a picture takes less time than with the fp32 kernels of the same processor
  /// Gives back what the processor keeps between products of a thread; may be null.
  void (*release)() = nullptr;
};

/// A thread must hold one while it runs products; the destructor releases what the processor keeps between
/// them (AMX tiles).
class ByteProducts {
 public:
  ByteProducts();
  ~ByteProducts();
  ByteProducts(const ByteProducts&) = delete;
  ByteProducts& operator=(const ByteProducts&) = delete;

 private:
  void (*release_)();
};

/// The best that this processor has within the set that isa_kernels() has chosen.
const ByteKernels& byte_kernels();

extern const ByteKernels kPlainByteKernels;
// Built for x86 alone, in single precision.
extern const ByteKernels kAvx2ByteKernels, kVnniByteKernels, kAmxByteKernels;

}  // namespace supertac::kernels
