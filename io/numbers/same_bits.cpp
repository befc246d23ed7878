#include "io/numbers/same_bits.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

namespace supertac::same_bits {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// ln 2 in two parts; the first has 21 trailing zeros, so that its product with an exponent is exact.
constexpr double kLn2High = 0x1.62e42feep-1, kLn2Low = 0x1.a39ef35793c76p-33;

// 1 / (n (n + 1)) steps of the Taylor series from its smallest term: `first` is 2 for cos and 3 for sin.
double alternating_series(double angle, int first) {
  const double square = angle * angle;
  double sum = 1;
  for (int n = first + 14; n >= first; n -= 2) sum = 1 - square / (n * (n - 1)) * sum;
  return sum;
}

double cosine_near_0(double turns) { return alternating_series(2 * std::numbers::pi * turns, 2); }
double sine_near_0(double turns) {
  const double angle = 2 * std::numbers::pi * turns;
  return angle * alternating_series(angle, 3);
}

}  // namespace

double exp(double x) {
  if (!(x <= 709.78)) return x > 0 ? kInfinity : x;  // NaN stays
  if (x < -708.39) return 0;
  const double power = std::floor(x / std::numbers::ln2 + 0.5);
  const double rest = (x - power * kLn2High) - power * kLn2Low;  // |rest| < 0.347: 14 terms reach 1e-17
  double sum = 1;
  for (int n = 14; n >= 1; --n) sum = 1 + rest / n * sum;
  const auto half = static_cast<std::int64_t>(power) / 2;  // 2^power in two factors: 2^1024 is not a number
  const auto two_to = [](std::int64_t e) {
    return std::bit_cast<double>(static_cast<std::uint64_t>(e + 1023) << 52);
  };
  return sum * two_to(half) * two_to(static_cast<std::int64_t>(power) - half);
}

// x = m 2^e with m in [sqrt(1/2), sqrt(2)), log m = 2 atanh((m - 1) / (m + 1)).
double log(double x) {
  if (!(x > 0) || x == kInfinity)
    return x == 0 ? -kInfinity : x > 0 ? x : std::numeric_limits<double>::quiet_NaN();
  if (x < std::numeric_limits<double>::min()) return log(x * 0x1p54) - 54 * std::numbers::ln2;
  const std::uint64_t word = std::bit_cast<std::uint64_t>(x);
  int exponent = static_cast<int>(word >> 52) - 1023;
  double mantissa = std::bit_cast<double>((word & 0xFFFFFFFFFFFFFull) | 0x3FF0000000000000ull);
  if (mantissa > std::numbers::sqrt2) {
    mantissa *= 0.5;
    exponent += 1;
  }
  const double s = (mantissa - 1) / (mantissa + 1);  // |s| < 0.172: eleven terms reach 1e-17
  double series = 0;
  for (int n = 21; n >= 1; n -= 2) series = series * (s * s) + 1.0 / n;
  return exponent * std::numbers::ln2 + 2 * s * series;
}

double pow(double x, double y) { return exp(y * log(x)); }

double cosine(double turns) {
  const double off = std::abs(turns - std::nearbyint(turns));  // exact, as are the differences below
  if (off <= 0.125) return cosine_near_0(off);
  return off < 0.375 ? sine_near_0(0.25 - off) : -cosine_near_0(0.5 - off);
}

double sine(double turns) {
  const double signed_off = turns - std::nearbyint(turns), off = std::abs(signed_off);
  const double value = off <= 0.125  ? sine_near_0(off)
                       : off < 0.375 ? cosine_near_0(0.25 - off)
                                     : sine_near_0(0.5 - off);
  return std::copysign(value, signed_off);
}

double rough_sine(double turns) {
  double u = turns - std::floor(turns);
  const double sign = u < 0.5 ? 1 : -1;
  if (u >= 0.5) u -= 0.5;
  const double q = 4 * (u - 0.25), q2 = q * q;  // cos(pi q / 2), |q| <= 1
  return sign * (1 - q2 * (1.2333 - q2 * (0.2526 - q2 * 0.0193)));
}

double bell(double distance, double sigma) {
  const double rest = std::max(0.0, 1 - distance * distance / (16 * sigma * sigma));
  const double squared = rest * rest, fourth = squared * squared;
  return fourth * fourth;
}

}  // namespace supertac::same_bits
