#ifndef SUPERTAC_REAL_IS_DOUBLE
#include <immintrin.h>

#include "autograd/kernels/fast/int8/int8.h"

namespace supertac::kernels {
namespace {

constexpr int kTile = 4;
template <int P>
constexpr int kVectors = P < 4 ? 4 / P : 1;  // few pixels need more vectors to hide the latency

alignas(32) const std::int32_t kLaneMask[16] = {-1, -1, -1, -1, -1, -1, -1, -1, 0, 0, 0, 0, 0, 0, 0, 0};

// The first of eight numbers of 32 bits.
inline __m256i load_part(const std::int32_t* p, Dim lanes) {
  const std::int32_t* mask = kLaneMask + 8 - (lanes < 8 ? lanes : 8);
  return _mm256_maskload_epi32(p, _mm256_loadu_si256(reinterpret_cast<const __m256i*>(mask)));
}

inline __m128i halves_together(__m256i whole) {
  return _mm_packs_epi32(_mm256_castsi256_si128(whole), _mm256_extracti128_si256(whole, 1));
}

// Eight outputs. Bytes are widened to 16 bits, since the instruction that multiplies bytes saturates: weights
// here, values before (widen). The quads of four outputs meet the same four values, and each output's two
// halves are added up at the end.
struct Sums {
  static constexpr Dim kLanes = 8;
  struct Weights {
    __m256i first, second;
  };
  using Value = std::int16_t;
  using Values = __m256i;
  __m256i first, second;

  static Sums zero() { return {_mm256_setzero_si256(), _mm256_setzero_si256()}; }
  static __m256i widened(const std::int8_t* p) {
    return _mm256_cvtepi8_epi16(_mm_loadu_si128(reinterpret_cast<const __m128i*>(p)));
  }
  static Weights weights(const std::int8_t* w) { return {widened(w), widened(w + 4 * kQuad)}; }
  static Values values(const Value* x) {
    return _mm256_castpd_si256(_mm256_broadcast_sd(reinterpret_cast<const double*>(x)));
  }
  void dot(Values x, const Weights& w) {
    first = _mm256_add_epi32(first, _mm256_madd_epi16(x, w.first));
    second = _mm256_add_epi32(second, _mm256_madd_epi16(x, w.second));
  }
  __m256i whole() const { return _mm256_permute4x64_epi64(_mm256_hadd_epi32(first, second), 0xD8); }

  struct Finish {
    /// Of outputs from `channel` on, of which so many are left.
    Finish(const Outcome& o, Dim channel, Dim left)
        : lanes(static_cast<std::size_t>(left < kLanes ? left : kLanes)),
          multiplier(load_part(o.multiplier + channel, left)),
          offset(load_part(o.offset + channel, left)),
          shift(load_part(o.shift + channel, left)),
          slope(_mm256_set1_epi32(o.negative_slope)),
          zero(_mm256_set1_epi32(o.zero)),
          rectifies(o.negative_slope != Outcome::kNoSlope) {}
    void operator()(Sums sum, std::int16_t* y, std::uint8_t* bytes) const {
      __m256i v = _mm256_mullo_epi32(sum.whole(), multiplier);
      v = _mm256_srav_epi32(_mm256_add_epi32(v, offset), shift);
      if (rectifies) {
        const __m256i sloped =
            _mm256_add_epi32(_mm256_mullo_epi32(v, slope), _mm256_set1_epi32(Outcome::kSlopeHalf));
        v = _mm256_max_epi32(v, _mm256_srai_epi32(sloped, Outcome::kSlopeBits));
      }
      if (y != nullptr) {
        const __m128i numbers = halves_together(v);
        __builtin_memcpy(y, &numbers, lanes * sizeof *y);
        return;
      }
      const __m128i words = halves_together(_mm256_add_epi32(v, zero));
      const __m128i all = _mm_packus_epi16(words, words);
      __builtin_memcpy(bytes, &all, lanes);
    }
    std::size_t lanes;
    __m256i multiplier, offset, shift, slope, zero;
    bool rectifies;
  };
};

#include "autograd/kernels/fast/int8/loops.inl"

void widen(Dim n, const std::uint8_t* from, std::int16_t* to) {
  Dim i = 0;
  for (; i + 16 <= n; i += 16)
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(to + i),
                        _mm256_cvtepu8_epi16(_mm_loadu_si128(reinterpret_cast<const __m128i*>(from + i))));
  for (; i < n; ++i) to[i] = from[i];
}

void run_widened(const ByteProductJob& job, const std::uint8_t* x, std::int16_t* y, std::uint8_t* bytes) {
  const ByteReach reach = reach_of(job);
  for (Dim n = 0; n < job.images; ++n)
    widen(reach.count, x + n * job.from.image - reach.before, job.scratch + n * reach.count);
  ByteProductJob wide = job;
  wide.from.image = reach.count;
  run(wide, job.scratch + reach.before, y, bytes);
}

}  // namespace

const ByteKernels kAvx2ByteKernels{run_widened};

}  // namespace supertac::kernels

#endif  // SUPERTAC_REAL_IS_DOUBLE
