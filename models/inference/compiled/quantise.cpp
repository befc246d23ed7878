#include "models/inference/compiled/quantise.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace supertac {
namespace {

constexpr int kMultiplierBits = 6, kLeastShift = 6, kMostShift = 29;
constexpr double kLargestWeight = 127, kMostSum = 1 << 30, kMostOffset = 1 << 29;

// The smallest multiplier / 2^shift that is no less than `target`, as fine as the bits allow.
struct Factor {
  std::int32_t multiplier, shift;
  double value() const { return std::ldexp(multiplier, -shift); }
};

Factor at_shift(double target, int shift) {
  const double multiplier = std::clamp(std::ceil(std::ldexp(target, shift)), 1.0, 1048576.0);
  return {static_cast<std::int32_t>(multiplier), shift};
}

Factor factor_of(double target, double bias_steps) {
  int exponent = 0, room = 0;
  std::frexp(target, &exponent);
  std::frexp(bias_steps, &room);  // the bias is shifted too
  const int most = std::clamp(kMostShift - 1 - room, kLeastShift, kMostShift);
  return at_shift(target, std::clamp(kMultiplierBits - exponent, kLeastShift, most));
}

}  // namespace

QuantisedProduct quantise(Dim rows, std::span<const real> w, std::span<const real> bias, const Scale& from,
                          const Scale& to) {
  const auto count = static_cast<std::size_t>(rows), outputs = bias.size();
  QuantisedProduct q{rows, static_cast<Dim>(outputs), std::vector<std::int8_t>(w.size()), {}, {}, {}};
  std::vector<double> sums(outputs);
  for (std::size_t o = 0; o < outputs; ++o) {
    double largest = 0;
    for (std::size_t k = 0; k < count; ++k)
      largest = std::max(largest, std::abs(static_cast<double>(w[k * outputs + o])));
    const double bias_steps = static_cast<double>(bias[o]) / to.step;
    Factor factor = factor_of(largest / kLargestWeight * from.step / to.step, bias_steps);
    for (bool fits = false; !fits;) {
      const double step = factor.value() * to.step / from.step;
      double sum = 0, magnitude = 0;
      for (std::size_t k = 0; k < count; ++k) {
        const double whole = std::clamp(std::rint(static_cast<double>(w[k * outputs + o]) / step),
                                        -kLargestWeight, kLargestWeight);
        q.w[k * outputs + o] = static_cast<std::int8_t>(whole);
        sum += whole, magnitude += std::abs(whole);
      }
      const double most = magnitude * from.largest;
      sums[o] = sum;
      fits = from.largest > 255 ? most < 2 * kMostSum : most * factor.multiplier <= kMostSum;
      if (fits || factor.multiplier == 1) break;
      factor = factor.shift > kLeastShift ? Factor{(factor.multiplier + 1) / 2, factor.shift - 1}
                                          : Factor{factor.multiplier / 2, factor.shift};
    }
    q.multiplier.push_back(factor.multiplier);
    q.shift.push_back(factor.shift);
  }
  for (std::size_t o = 0; o < outputs; ++o) {
    const double scaled = std::ldexp(static_cast<double>(bias[o]) / to.step, q.shift[o]);
    q.offset.push_back((1 << (q.shift[o] - 1)) +
                       static_cast<std::int32_t>(std::rint(std::clamp(scaled, -kMostOffset, kMostOffset) -
                                                           sums[o] * from.zero * q.multiplier[o])));
  }
  return q;
}

Requantise requantise(double from_step, double to_step) {
  constexpr int kBits = 14;
  const double target = from_step / to_step;
  int exponent = 0;
  std::frexp(target, &exponent);
  const int shift = std::clamp(kBits - exponent, 1, kMostShift);
  const double multiplier = std::clamp(std::rint(std::ldexp(target, shift)), 0.0, 32767.0);
  return {static_cast<std::int32_t>(multiplier), 1 << (shift - 1), shift};
}

}  // namespace supertac
