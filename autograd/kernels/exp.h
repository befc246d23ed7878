// e^x with the same bits on every processor: the C library's differ between machines.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

#include "autograd/tensor.h"

namespace supertac::kernels {

#ifdef SUPERTAC_REAL_IS_DOUBLE
// The double build checks gradients, it makes no promise.
inline double exp_same_bits(double x) { return std::exp(x); }
#else
/// Relative error below 2e-7; x is limited to [-87, 88], where the result is normal and finite.
inline float exp_same_bits(float x) {
  x = x < -87.0F ? -87.0F : x;
  x = x > 88.0F ? 88.0F : x;
  // e^x = 2^n e^r with |r| <= ln(2)/2; ln(2) in two parts so that n ln(2) is exact.
  const float shifted = x * 1.44269504F + 12582912.0F;  // 1.5 * 2^23: rounds to an integer in the low bits
  const float n = shifted - 12582912.0F;
  const float r = (x - n * 0.693359375F) - n * -2.12194440e-4F;
  float p = 1.0F / 5040.0F;  // the Taylor series: at |r| < 0.35 the next term is below 6e-9
  p = p * r + 1.0F / 720.0F;
  p = p * r + 1.0F / 120.0F;
  p = p * r + 1.0F / 24.0F;
  p = p * r + 1.0F / 6.0F;
  p = p * r + 0.5F;
  p = p * r + 1.0F;
  p = p * r + 1.0F;
  const auto bits = std::bit_cast<std::int32_t>(shifted) - std::bit_cast<std::int32_t>(12582912.0F);
  return p * std::bit_cast<float>((bits + 127) << 23);
}
#endif

inline real sigmoid_same_bits(real x) {
  const real e = exp_same_bits(x < 0 ? x : -x);  // in (0, 1]: no overflow on either side
  const real s = 1 / (1 + e);
  return x < 0 ? e * s : s;
}

}  // namespace supertac::kernels
