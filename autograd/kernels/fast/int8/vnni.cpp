#ifndef SUPERTAC_REAL_IS_DOUBLE
#include "autograd/kernels/fast/int8/finish512.h"

namespace supertac::kernels {
namespace {

constexpr int kTile = 8;
template <int P>
constexpr int kVectors = P <= 2 ? 4 : 2;  // few pixels need more vectors to hide the latency

struct Sums {
  static constexpr Dim kLanes = 16;
  using Value = std::uint8_t;
  using Weights = __m512i;
  using Values = __m512i;
  __m512i v;

  static Sums zero() { return {_mm512_setzero_si512()}; }
  static Weights weights(const std::int8_t* w) { return _mm512_loadu_si512(w); }
  static Values values(const std::uint8_t* x) {
    std::int32_t quad;
    __builtin_memcpy(&quad, x, sizeof quad);
    return _mm512_set1_epi32(quad);
  }
  void dot(Values x, Weights w) { v = _mm512_dpbusd_epi32(v, x, w); }

  struct Finish : PartFinish {
    using PartFinish::PartFinish;
    void operator()(Sums sum, float* y, std::uint8_t* bytes) const {
      PartFinish::operator()(sum.v, y, bytes);
    }
  };
};

#include "autograd/kernels/fast/int8/loops.inl"

void line_to_bytes(Dim n, const float* x, Steps steps, std::uint8_t* bytes) {
  const __m512 per_step = _mm512_set1_ps(steps.per_step),
               first = _mm512_set1_ps(static_cast<float>(steps.zero));
  Dim i = 0;
  for (; i + 16 <= n; i += 16) store_bytes(to_steps(_mm512_loadu_ps(x + i), per_step, first), bytes + i);
  if (i == n) return;
  const __mmask16 mask = mask_of(n - i);
  const __m512i whole = to_steps(_mm512_maskz_loadu_ps(mask, x + i), per_step, first);
  _mm512_mask_cvtusepi32_storeu_epi8(bytes + i, mask, whole);
}

}  // namespace

const ByteKernels kVnniByteKernels{run, line_to_bytes};

}  // namespace supertac::kernels

#endif  // SUPERTAC_REAL_IS_DOUBLE
