// Products of bytes, for networks that are prepared with less than fp32 (models/inference/prepared.h). Sums
// of integers are exact: every instruction set, and every order, gives the same bits.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "autograd/kernels/fast/inference.h"

namespace supertac::kernels {

/// A number x stands for the byte round(x / step) + zero, limited to 0 .. 255.
struct Steps {
  float step = 1;
  std::int32_t zero = 0;
  float per_step = 1 / step;  ///< divided once, not for every tile
};

/// What becomes of a sum s of output o: y = f(s * scale[o] + bias[o]), f as in ProductJob, written as a float
/// and, where asked for, as the byte that stands for it.
struct Outcome {
  const float* scale = nullptr;  // [cout]
  const float* bias = nullptr;   // [cout]
  float negative_slope = 1;      // at most 1
  Steps steps;
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
  Dim cout = 0, kept = 0;  // of cout outputs the first are kept
  Outcome outcome = {};
  const BytePlaces* places = nullptr;  // of an image, places_of()
  Dim place_count = 0;
  std::int16_t* scratch = nullptr;  // images * reach_of(job).count, for kernels that multiply wider numbers
};
inline constexpr Dim kQuad = 4, kByteOutputs = 16;

/// All places of an image, sixteen at a time, each pixel once: the last sixteen begin sooner where they are
/// no multiple. None where there are fewer or lines are no multiple of from.pixel apart.
std::vector<BytePlaces> places_of(const ByteProductJob& job);

/// The bytes of an image that a job reads: from `before` bytes before x on.
struct ByteReach {
  Dim before = 0, count = 0;
};
ByteReach reach_of(const ByteProductJob& job);

/// A kernel of one instruction set; either result may be null.
using ByteProduct = void (*)(const ByteProductJob& job, const std::uint8_t* x, float* y, std::uint8_t* bytes);

struct ByteKernels {
  ByteProduct product;
  void (*line_to_bytes)(Dim n, const float* x, Steps steps, std::uint8_t* bytes);
  /// Gives back what the processor keeps between products of a thread; may be null.
  void (*release)() = nullptr;
};

/// While it lives its thread runs products, with whatever they keep; products need one.
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

/// bytes = the bytes that stand for the numbers of maps [height][line], x and bytes each with its strides.
struct ToBytesJob {
  Dim images = 1, height = 1, line = 0;
  Strides from, to;
  Steps steps;
};
void to_bytes(const ToBytesJob& job, const float* x, std::uint8_t* bytes);

extern const ByteKernels kPlainByteKernels;
// Built for x86 alone, in single precision.
extern const ByteKernels kAvx2ByteKernels, kVnniByteKernels, kAmxByteKernels;

}  // namespace supertac::kernels
