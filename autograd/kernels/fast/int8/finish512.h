// The formula of Outcome (int8.h) for vectors of 16 sums, for vnni.cpp and amx.cpp.
#pragma once

#include <immintrin.h>

#include "autograd/kernels/fast/int8/int8.h"

namespace supertac::kernels {
namespace {

inline __mmask16 mask_of(Dim lanes) {
  return lanes < 16 ? static_cast<__mmask16>((1U << lanes) - 1U) : 0xFFFF;
}

inline __m512i load_part(const std::int32_t* p, Dim lanes) {
  return _mm512_maskz_loadu_epi32(mask_of(lanes), p);
}

// Of sixteen outputs, or the first `left` of them.
struct Finish {
  Finish() = default;
  Finish(const Outcome& o, Dim channel, Dim left = 16)
      : multiplier(load_part(o.multiplier + channel, left)),
        offset(load_part(o.offset + channel, left)),
        shift(load_part(o.shift + channel, left)),
        slope(_mm512_set1_epi32(o.negative_slope)),
        zero(_mm512_set1_epi32(o.zero)),
        mask(mask_of(left)),
        rectifies(o.negative_slope != Outcome::kNoSlope) {}
  __attribute__((always_inline)) void operator()(__m512i sum, std::int16_t* y, std::uint8_t* bytes) const {
    __m512i v = _mm512_srav_epi32(_mm512_add_epi32(_mm512_mullo_epi32(sum, multiplier), offset), shift);
    if (rectifies) {
      const __m512i sloped =
          _mm512_add_epi32(_mm512_mullo_epi32(v, slope), _mm512_set1_epi32(Outcome::kSlopeHalf));
      v = _mm512_max_epi32(v, _mm512_srai_epi32(sloped, Outcome::kSlopeBits));
    }
    if (y != nullptr) return _mm512_mask_cvtsepi32_storeu_epi16(y, mask, v);
    const __m512i positive = _mm512_max_epi32(_mm512_add_epi32(v, zero), _mm512_setzero_si512());
    _mm512_mask_cvtusepi32_storeu_epi8(bytes, mask, positive);
  }
  __m512i multiplier, offset, shift, slope, zero;
  __mmask16 mask;
  bool rectifies;
};

}  // namespace
}  // namespace supertac::kernels
