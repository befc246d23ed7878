#ifndef SUPERTAC_REAL_IS_DOUBLE
#include <immintrin.h>

#include "autograd/kernels/fast/int8/int8.h"

namespace supertac::kernels {
namespace {

constexpr int kTile = 4;
template <int P>
constexpr int kVectors = P < 4 ? 4 / P : 1;  // few pixels need more vectors to hide the latency

alignas(32) const std::int32_t kLaneMask[16] = {-1, -1, -1, -1, -1, -1, -1, -1, 0, 0, 0, 0, 0, 0, 0, 0};

inline __m256i mask_of(Dim lanes) {
  return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(kLaneMask + 8 - (lanes < 8 ? lanes : 8)));
}

inline void store_bytes(__m256 value, __m256 per_step, __m256 first, Dim lanes, std::uint8_t* bytes) {
  const __m256 level = _mm256_fmadd_ps(value, per_step, first);  // not a number counts as 0
  const __m256 within = _mm256_min_ps(_mm256_max_ps(level, _mm256_setzero_ps()), _mm256_set1_ps(255));
  const __m256i whole = _mm256_cvtps_epi32(within);
  const __m128i halves = _mm_packs_epi32(_mm256_castsi256_si128(whole), _mm256_extracti128_si256(whole, 1));
  const __m128i all = _mm_packus_epi16(halves, halves);
  if (lanes == 8) return _mm_storel_epi64(reinterpret_cast<__m128i*>(bytes), all);
  const std::int64_t some = _mm_cvtsi128_si64(all);
  __builtin_memcpy(bytes, &some, static_cast<std::size_t>(lanes));
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
    Finish(const Outcome& o, Dim left, __m256 s, __m256 b)
        : lanes(left < kLanes ? left : kLanes),
          mask(mask_of(left)),
          scale(s),
          bias(b),
          slope(_mm256_set1_ps(o.negative_slope)),
          per_step(_mm256_set1_ps(o.steps.per_step)),
          first(_mm256_set1_ps(static_cast<float>(o.steps.zero))),
          rectifies(o.negative_slope != 1) {}
    /// Of outputs from `channel` on, of which so many are left.
    Finish(const Outcome& o, Dim channel, Dim left)
        : Finish(o, left, _mm256_maskload_ps(o.scale + channel, mask_of(left)),
                 _mm256_maskload_ps(o.bias + channel, mask_of(left))) {}
    void operator()(Sums sum, float* y, std::uint8_t* bytes) const {
      __m256 value = _mm256_fmadd_ps(_mm256_cvtepi32_ps(sum.whole()), scale, bias);
      const __m256 nothing = _mm256_setzero_ps();
      if (rectifies) {
        const __m256 positive = _mm256_cmp_ps(value, nothing, _CMP_GT_OQ);
        value = _mm256_blendv_ps(_mm256_mul_ps(slope, value), value, positive);
      }
      if (y != nullptr && lanes == kLanes) _mm256_storeu_ps(y, value);
      if (y != nullptr && lanes < kLanes) _mm256_maskstore_ps(y, mask, value);
      if (bytes == nullptr) return;
      store_bytes(value, per_step, first, lanes, bytes);
    }
    Dim lanes;
    __m256i mask;
    __m256 scale, bias, slope, per_step, first;
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

void run_widened(const ByteProductJob& job, const std::uint8_t* x, float* y, std::uint8_t* bytes) {
  const ByteReach reach = reach_of(job);
  for (Dim n = 0; n < job.images; ++n)
    widen(reach.count, x + n * job.from.image - reach.before, job.scratch + n * reach.count);
  ByteProductJob wide = job;
  wide.from.image = reach.count;
  run(wide, job.scratch + reach.before, y, bytes);
}

void line_to_bytes(Dim n, const float* x, Steps steps, std::uint8_t* bytes) {
  const __m256 per_step = _mm256_set1_ps(steps.per_step),
               first = _mm256_set1_ps(static_cast<float>(steps.zero));
  for (Dim i = 0; i < n; i += 8) {
    const Dim lanes = n - i < 8 ? n - i : 8;
    store_bytes(_mm256_maskload_ps(x + i, mask_of(lanes)), per_step, first, lanes, bytes + i);
  }
}

}  // namespace

const ByteKernels kAvx2ByteKernels{run_widened, line_to_bytes};

}  // namespace supertac::kernels

#endif  // SUPERTAC_REAL_IS_DOUBLE
