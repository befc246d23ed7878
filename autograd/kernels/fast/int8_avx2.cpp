#ifndef SUPERTAC_REAL_IS_DOUBLE
#include <immintrin.h>

#include "autograd/kernels/fast/int8.h"

namespace supertac::kernels {
namespace {

constexpr int kTile = 4;

alignas(32) const std::int32_t kLaneMask[16] = {-1, -1, -1, -1, -1, -1, -1, -1, 0, 0, 0, 0, 0, 0, 0, 0};

inline __m256i mask_of(Dim lanes) {
  return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(kLaneMask + 8 - (lanes < 8 ? lanes : 8)));
}

inline void store_bytes(__m256 value, __m256 per_step, __m256 first, Dim lanes, std::uint8_t* bytes) {
  const __m256 level = _mm256_fmadd_ps(value, per_step, first);  // not a number counts as 0
  const __m256 within = _mm256_min_ps(_mm256_max_ps(level, _mm256_setzero_ps()), _mm256_set1_ps(255));
  const __m256i whole = _mm256_cvtps_epi32(within);
  const __m128i halves = _mm_packs_epi32(_mm256_castsi256_si128(whole), _mm256_extracti128_si256(whole, 1));
  const std::int64_t all = _mm_cvtsi128_si64(_mm_packus_epi16(halves, halves));
  __builtin_memcpy(bytes, &all, static_cast<std::size_t>(lanes));
}

// Bytes are widened to 16 bits, even and odd places apart: the instruction that multiplies bytes saturates.
struct Sums {
  static constexpr Dim kLanes = 8;
  struct Pairs {
    __m256i even, odd;
  };
  using Weights = Pairs;
  using Values = Pairs;
  __m256i v;

  static Sums zero() { return {_mm256_setzero_si256()}; }
  static __m256i load(const void* p) { return _mm256_loadu_si256(static_cast<const __m256i*>(p)); }
  static __m256i same(const void* p) {
    std::int32_t quad;
    __builtin_memcpy(&quad, p, sizeof quad);
    return _mm256_set1_epi32(quad);
  }
  static Pairs with_sign(__m256i quads) {
    return {_mm256_srai_epi16(_mm256_slli_epi16(quads, 8), 8), _mm256_srai_epi16(quads, 8)};
  }
  static Pairs without_sign(__m256i quads) {
    return {_mm256_and_si256(quads, _mm256_set1_epi16(0xFF)), _mm256_srli_epi16(quads, 8)};
  }
  static Weights weights(const std::int8_t* w) { return with_sign(load(w)); }
  static Values values(const std::uint8_t* x) { return without_sign(same(x)); }
  void dot(const Values& x, const Weights& w) {
    v = _mm256_add_epi32(v, _mm256_madd_epi16(x.even, w.even));
    v = _mm256_add_epi32(v, _mm256_madd_epi16(x.odd, w.odd));
  }

  struct Finish {
    Finish(const Outcome& o, Dim left, __m256 s, __m256 b)
        : lanes(left < kLanes ? left : kLanes),
          mask(mask_of(left)),
          scale(s),
          bias(b),
          slope(_mm256_set1_ps(o.negative_slope)),
          per_step(_mm256_set1_ps(1 / o.steps.step)),
          first(_mm256_set1_ps(static_cast<float>(o.steps.zero))),
          rectifies(o.negative_slope != 1) {}
    /// Of outputs from `channel` on, of which so many are left.
    Finish(const Outcome& o, Dim channel, Dim left)
        : Finish(o, left, _mm256_maskload_ps(o.scale + channel, mask_of(left)),
                 _mm256_maskload_ps(o.bias + channel, mask_of(left))) {}
    void operator()(Sums sum, float* y, std::uint8_t* bytes) const {
      __m256 value = _mm256_fmadd_ps(_mm256_cvtepi32_ps(sum.v), scale, bias);
      const __m256 nothing = _mm256_setzero_ps();
      if (rectifies) {
        const __m256 positive = _mm256_cmp_ps(value, nothing, _CMP_GT_OQ);
        value = _mm256_blendv_ps(_mm256_mul_ps(slope, value), value, positive);
      }
      if (y != nullptr) _mm256_maskstore_ps(y, mask, value);
      if (bytes == nullptr) return;
      store_bytes(value, per_step, first, lanes, bytes);
    }
    Dim lanes;
    __m256i mask;
    __m256 scale, bias, slope, per_step, first;
    bool rectifies;
  };
};

#include "autograd/kernels/fast/int8_loops.inl"

void line_to_bytes(Dim n, const float* x, Steps steps, std::uint8_t* bytes) {
  const __m256 per_step = _mm256_set1_ps(1 / steps.step),
               first = _mm256_set1_ps(static_cast<float>(steps.zero));
  for (Dim i = 0; i < n; i += 8) {
    const Dim lanes = n - i < 8 ? n - i : 8;
    store_bytes(_mm256_maskload_ps(x + i, mask_of(lanes)), per_step, first, lanes, bytes + i);
  }
}

}  // namespace

const ByteKernels kAvx2ByteKernels{run_bytes, line_to_bytes};

}  // namespace supertac::kernels

#endif  // SUPERTAC_REAL_IS_DOUBLE
