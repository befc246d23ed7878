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

  struct Finish : kernels::Finish {
    using kernels::Finish::Finish;
    void operator()(Sums sum, std::int16_t* y, std::uint8_t* bytes) const {
      kernels::Finish::operator()(sum.v, y, bytes);
    }
  };
};

#include "autograd/kernels/fast/int8/loops.inl"

}  // namespace

const ByteKernels kVnniByteKernels{run, true};

}  // namespace supertac::kernels

#endif  // SUPERTAC_REAL_IS_DOUBLE
