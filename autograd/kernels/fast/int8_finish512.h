// What becomes of sums of bytes in vectors of 16, for int8_vnni.cpp and int8_amx.cpp.
#pragma once

#include <immintrin.h>

#include "autograd/kernels/fast/int8.h"

namespace supertac::kernels {
namespace {

inline __mmask16 mask_of(Dim lanes) {
  return lanes < 16 ? static_cast<__mmask16>((1U << lanes) - 1U) : 0xFFFF;
}

inline void store_bytes(__m512 value, __m512 per_step, __m512 first, __mmask16 mask, std::uint8_t* bytes) {
  const __m512 level = _mm512_fmadd_ps(value, per_step, first);  // not a number counts as 0
  // What is too large for a whole number becomes the largest one without a sign.
  const __m512i whole = _mm512_cvtps_epi32(_mm512_max_ps(level, _mm512_setzero_ps()));
  if (mask == 0xFFFF) {
    _mm_storeu_si128(reinterpret_cast<__m128i*>(bytes), _mm512_cvtusepi32_epi8(whole));
  } else {
    _mm512_mask_cvtusepi32_storeu_epi8(bytes, mask, whole);
  }
}

struct Finish {
  Finish() = default;
  Finish(const Outcome& o, Dim lanes, __m512 s, __m512 b)
      : mask(mask_of(lanes)),
        scale(s),
        bias(b),
        slope(_mm512_set1_ps(o.negative_slope)),
        per_step(_mm512_set1_ps(o.steps.per_step)),
        first(_mm512_set1_ps(static_cast<float>(o.steps.zero))),
        rectifies(o.negative_slope != 1) {}
  /// Of outputs from `channel` on, of which so many are left.
  Finish(const Outcome& o, Dim channel, Dim left)
      : Finish(o, left, _mm512_maskz_loadu_ps(mask_of(left), o.scale + channel),
               _mm512_maskz_loadu_ps(mask_of(left), o.bias + channel)) {}
  void operator()(__m512i sum, float* y, std::uint8_t* bytes) const {
    __m512 value = _mm512_fmadd_ps(_mm512_cvtepi32_ps(sum), scale, bias);
    if (rectifies) {
      const __mmask16 negative = _mm512_cmp_ps_mask(value, _mm512_setzero_ps(), _CMP_NGT_UQ);
      value = _mm512_mask_mul_ps(value, negative, slope, value);
    }
    if (y != nullptr) _mm512_mask_storeu_ps(y, mask, value);
    if (bytes == nullptr) return;
    store_bytes(value, per_step, first, mask, bytes);
  }
  __mmask16 mask;
  __m512 scale, bias, slope, per_step, first;
  bool rectifies;
};

}  // namespace
}  // namespace supertac::kernels
