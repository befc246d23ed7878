// What becomes of sums of bytes in vectors of 16, for int8_vnni.cpp and int8_amx.cpp.
#pragma once

#include <immintrin.h>

#include "autograd/kernels/fast/int8/int8.h"

namespace supertac::kernels {
namespace {

inline __mmask16 mask_of(Dim lanes) {
  return lanes < 16 ? static_cast<__mmask16>((1U << lanes) - 1U) : 0xFFFF;
}

// The bytes that stand for values, as whole numbers of 32 bits: what is too large for one becomes the largest
// without a sign, which a byte is limited to 255 of; not a number counts as 0.
inline __m512i to_steps(__m512 value, __m512 per_step, __m512 first) {
  return _mm512_cvtps_epi32(_mm512_max_ps(_mm512_fmadd_ps(value, per_step, first), _mm512_setzero_ps()));
}

inline void store_bytes(__m512i whole, std::uint8_t* bytes) {
  _mm_storeu_si128(reinterpret_cast<__m128i*>(bytes), _mm512_cvtusepi32_epi8(whole));
}

// Of sixteen outputs.
struct Finish {
  Finish() = default;
  Finish(const Outcome& o, __m512 s, __m512 b)
      : scale(s),
        bias(b),
        slope(_mm512_set1_ps(o.negative_slope)),
        per_step(_mm512_set1_ps(o.steps.per_step)),
        first(_mm512_set1_ps(static_cast<float>(o.steps.zero))) {}
  Finish(const Outcome& o, Dim channel)
      : Finish(o, _mm512_loadu_ps(o.scale + channel), _mm512_loadu_ps(o.bias + channel)) {}
  __m512 value(__m512i sum) const {
    const __m512 v = _mm512_fmadd_ps(_mm512_cvtepi32_ps(sum), scale, bias);
    return _mm512_max_ps(v, _mm512_mul_ps(v, slope));
  }
  __attribute__((always_inline)) void operator()(__m512i sum, float* y, std::uint8_t* bytes) const {
    const __m512 v = value(sum);
    if (y != nullptr) _mm512_storeu_ps(y, v);
    if (bytes != nullptr) store_bytes(to_steps(v, per_step, first), bytes);
  }
  __m512 scale, bias, slope, per_step, first;
};

// Of the first `left` of sixteen outputs.
struct PartFinish : Finish {
  PartFinish(const Outcome& o, Dim channel, Dim left)
      : Finish(o, _mm512_maskz_loadu_ps(mask_of(left), o.scale + channel),
               _mm512_maskz_loadu_ps(mask_of(left), o.bias + channel)),
        mask(mask_of(left)) {}
  void operator()(__m512i sum, float* y, std::uint8_t* bytes) const {
    if (mask == 0xFFFF) return Finish::operator()(sum, y, bytes);
    const __m512 v = value(sum);
    if (y != nullptr) _mm512_mask_storeu_ps(y, mask, v);
    if (bytes != nullptr) _mm512_mask_cvtusepi32_storeu_epi8(bytes, mask, to_steps(v, per_step, first));
  }
  __mmask16 mask;
};

}  // namespace
}  // namespace supertac::kernels
