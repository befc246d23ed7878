#include "io/numbers/random.h"

#include <cmath>
#include <limits>

#include "io/numbers/same_bits.h"

namespace supertac {
namespace {

std::uint32_t low_word(std::uint64_t value) { return static_cast<std::uint32_t>(value); }
std::uint32_t high_word(std::uint64_t value) { return static_cast<std::uint32_t>(value >> 32); }

// numerator[0] + numerator[1] x + ... over the same of the denominator.
double ratio(const std::array<double, 8>& numerator, const std::array<double, 8>& denominator, double x) {
  double above = numerator[7];
  double below = denominator[7];
  for (int i = 6; i >= 0; --i) {
    above = above * x + numerator[i];
    below = below * x + denominator[i];
  }
  return above / below;
}

// The coefficients printed in AS 241, for |p - 1/2| <= 0.425, for the tails, and for the far tails.
constexpr std::array<double, 8> kA = {
    3.3871328727963666080e0,  1.3314166789178437745e+2, 1.9715909503065514427e+3, 1.3731693765509461125e+4,
    4.5921953931549871457e+4, 6.7265770927008700853e+4, 3.3430575583588128105e+4, 2.5090809287301226727e+3};
constexpr std::array<double, 8> kB = {
    1.0000000000000000000e0,  4.2313330701600911252e+1, 6.8718700749205790830e+2, 5.3941960214247511077e+3,
    2.1213794301586595867e+4, 3.9307895800092710610e+4, 2.8729085735721942674e+4, 5.2264952788528545610e+3};
constexpr std::array<double, 8> kC = {1.42343711074968357734e0,  4.63033784615654529590e0,
                                      5.76949722146069140550e0,  3.64784832476320460504e0,
                                      1.27045825245236838258e0,  2.41780725177450611770e-1,
                                      2.27238449892691845833e-2, 7.74545014278341407640e-4};
constexpr std::array<double, 8> kD = {1.0000000000000000000e0,   2.05319162663775882187e0,
                                      1.67638483018380384940e0,  6.89767334985100004550e-1,
                                      1.48103976427480074590e-1, 1.51986665636164571966e-2,
                                      5.47593808499534494600e-4, 1.05075007164441684324e-9};
constexpr std::array<double, 8> kE = {6.65790464350110377720e0,  5.46378491116411436990e0,
                                      1.78482653991729133580e0,  2.96560571828504891230e-1,
                                      2.65321895265761230930e-2, 1.24266094738807843860e-3,
                                      2.71155556874348757815e-5, 2.01033439929228813265e-7};
constexpr std::array<double, 8> kF = {1.0000000000000000000e0,   5.99832206555887937690e-1,
                                      1.36929880922735805310e-1, 1.48753612908506148525e-2,
                                      7.86869131145613259100e-4, 1.84631831751005468180e-5,
                                      1.42151175831644588870e-7, 2.04426310338993978564e-15};

}  // namespace

std::array<std::uint32_t, 4> philox(std::array<std::uint32_t, 4> counter, std::array<std::uint32_t, 2> key) {
  for (int round = 0; round < 10; ++round) {
    const std::uint64_t first = std::uint64_t{0xD2511F53u} * counter[0];
    const std::uint64_t second = std::uint64_t{0xCD9E8D57u} * counter[2];
    counter = {high_word(second) ^ counter[1] ^ key[0], low_word(second),
               high_word(first) ^ counter[3] ^ key[1], low_word(first)};
    key = {key[0] + 0x9E3779B9u, key[1] + 0xBB67AE85u};
  }
  return counter;
}

double inverse_normal(double p) {
  if (!(p > 0 && p < 1)) return std::numeric_limits<double>::quiet_NaN();
  const double q = p - 0.5;
  if (std::abs(q) <= 0.425) return q * ratio(kA, kB, 0.180625 - q * q);
  const double r = std::sqrt(-same_bits::log(q < 0 ? p : 1 - p));
  const double x = r <= 5 ? ratio(kC, kD, r - 1.6) : ratio(kE, kF, r - 5);
  return q < 0 ? -x : x;
}

std::uint64_t RandomStream::word64(std::uint64_t counter) const {
  const auto words = philox({low_word(counter), high_word(counter), low_word(stream_), high_word(stream_)},
                            {low_word(seed_), high_word(seed_)});
  return words[0] | std::uint64_t{words[1]} << 32;
}

std::uint32_t RandomStream::bits(std::uint64_t counter) const { return low_word(word64(counter)); }

double RandomStream::uniform(std::uint64_t counter) const {
  return static_cast<double>(word64(counter) >> 11) * 0x1p-53;
}

double RandomStream::normal(std::uint64_t counter) const {
  // The middle of one of 2^52 cells: never 0 or 1, and symmetric about 1/2.
  return inverse_normal((static_cast<double>(word64(counter) >> 12) + 0.5) * 0x1p-52);
}

}  // namespace supertac
