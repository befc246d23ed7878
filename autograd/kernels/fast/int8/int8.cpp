#include "autograd/kernels/fast/int8/int8.h"

#include <algorithm>
#include <span>

#if defined(__x86_64__) && defined(__linux__)
#include <cpuid.h>
#include <sys/syscall.h>
#include <unistd.h>
#endif

#include "autograd/kernels/fast/isa/isa.h"

namespace supertac::kernels {
namespace {

void finish(const Outcome& to, Dim o, std::int32_t sum, std::int16_t* y, std::uint8_t* bytes) {
  std::int32_t v = (sum * to.multiplier[o] + to.offset[o]) >> to.shift[o];
  if (to.negative_slope != Outcome::kNoSlope)
    v = std::max(v, (v * to.negative_slope + Outcome::kSlopeHalf) >> Outcome::kSlopeBits);
  if (y != nullptr) y[o] = static_cast<std::int16_t>(std::clamp(v, -32768, 32767));
  if (bytes != nullptr) bytes[o] = static_cast<std::uint8_t>(std::clamp(v + to.zero, 0, 255));
}

// Whole sums of one pixel, then what becomes of them.
void plain_pixel(const ByteProductJob& job, const std::uint8_t* x, std::int16_t* y, std::uint8_t* bytes) {
  std::int32_t sum[kMaxChannels + kByteOutputs];
  for (Dim o = 0; o < job.cout; ++o) sum[o] = 0;
  const std::int8_t* w = job.w;
  for (Dim s = 0; s < job.segment_count; ++s) {
    for (Dim k = 0; k < job.length; k += kQuad, w += job.cout * kQuad) {
      const std::uint8_t* v = x + job.segments[s] + k;
      for (Dim o = 0; o < job.cout; ++o)
        sum[o] += v[0] * w[o * 4] + v[1] * w[o * 4 + 1] + v[2] * w[o * 4 + 2] + v[3] * w[o * 4 + 3];
    }
  }
  for (Dim o = 0; o < job.kept; ++o) finish(job.outcome, o, sum[o], y, bytes);
}

void product(const ByteProductJob& job, const std::uint8_t* x, std::int16_t* y, std::uint8_t* bytes) {
  for (Dim n = 0; n < job.images; ++n) {
    for (Dim i = 0; i < job.height; ++i) {
      for (Dim j = 0; j < job.width; ++j) {
        const Dim at = n * job.to.image + i * job.to.line + j * job.to.pixel;
        plain_pixel(job, x + n * job.from.image + i * job.from.line + j * job.from.pixel,
                    y ? y + at : nullptr, bytes ? bytes + at : nullptr);
      }
    }
  }
}

#if defined(__x86_64__) && !defined(SUPERTAC_REAL_IS_DOUBLE)
// Tiles are a part of the processor's state that Linux gives only to who asks for it.
bool may_use_tiles() {
#ifdef SYS_arch_prctl
  constexpr unsigned kTiles = 1U << 24, kBytes = 1U << 25;
  constexpr long kAskForState = 0x1023, kTileData = 18;
  unsigned a = 0, b = 0, c = 0, d = 0;
  return __get_cpuid_count(7, 0, &a, &b, &c, &d) != 0 && (d & kTiles) != 0 && (d & kBytes) != 0 &&
         syscall(SYS_arch_prctl, kAskForState, kTileData) == 0;
#else
  return false;
#endif
}
#endif

}  // namespace

std::vector<BytePlaces> places_of(const ByteProductJob& job) {
  constexpr Dim kAtOnce = 16;
  const Dim line = job.height > 1 ? job.from.line / job.from.pixel : job.width;
  const Dim count = (job.height - 1) * line + job.width;
  if (count < kAtOnce || (job.height > 1 && job.from.line % job.from.pixel != 0)) return {};
  std::vector<BytePlaces> all;
  for (Dim first = 0; first < count; first += kAtOnce) {
    const Dim begin = std::min(first, count - kAtOnce);
    BytePlaces places{.x = static_cast<std::int32_t>(begin * job.from.pixel)};
    for (Dim p = first - begin; p < kAtOnce; ++p) {
      const Dim i = (begin + p) / line, j = (begin + p) % line;
      if (j < job.width)
        places.pixels[static_cast<std::size_t>(places.count++)] = {
            static_cast<std::int32_t>(p), static_cast<std::int32_t>(i * job.to.line + j * job.to.pixel)};
    }
    all.push_back(places);
  }
  return all;
}

ByteReach reach_of(const ByteProductJob& job) {
  Dim lowest = 0, highest = 0;
  for (const Dim segment : std::span(job.segments, static_cast<std::size_t>(job.segment_count)))
    lowest = std::min(lowest, segment), highest = std::max(highest, segment);
  const Dim last_pixel = (job.height - 1) * job.from.line + (job.width - 1) * job.from.pixel;
  return {-lowest, last_pixel + highest + job.length - lowest};
}

const ByteKernels kPlainByteKernels{product};

const ByteKernels& byte_kernels() {
#if defined(__x86_64__) && !defined(SUPERTAC_REAL_IS_DOUBLE)
  static const bool has_vnni = __builtin_cpu_supports("avx512vnni"), has_tiles = may_use_tiles();
  const Vectors vectors = isa_kernels().vectors;
  if (vectors == Vectors::avx512 && has_vnni && has_tiles) return kAmxByteKernels;
  if (vectors == Vectors::avx512 && has_vnni) return kVnniByteKernels;
  if (vectors != Vectors::baseline) return kAvx2ByteKernels;
#endif
  return kPlainByteKernels;
}

ByteProducts::ByteProducts() : release_(byte_kernels().release) {}
ByteProducts::~ByteProducts() {
  if (release_ != nullptr) release_();
}

}  // namespace supertac::kernels
