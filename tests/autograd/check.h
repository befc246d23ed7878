// What the tests of ops share: numbers to feed in, and one-line checks of values, gradients and messages. The
// gradients of all ops are tested by the rows of apps/check/gradient_cases.cpp: `supertac-check gradients`
// compares them with differences, tests/layers/gradient_test.cpp tries them empty and with planted errors.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <vector>

#include "autograd/gradient_checker.h"
#include "autograd/ops/arithmetic.h"
#include "autograd/tensor.h"
#include "autograd/variable.h"
#include "io/numbers/hash.h"
#include "tests/support/test.h"

namespace supertac::test {

/// What is left of a hand-computed value after rounding.
inline constexpr double kRounding = sizeof(real) == 4 ? 2e-6 : 1e-14;

/// Irregular numbers in [low, high), a pure function of seed and place (splitmix64).
inline Tensor numbers(const Shape& shape, std::uint64_t seed = 1, double low = -1, double high = 1) {
  Tensor t(shape);
  for (Dim i = 0; i < t.size(); ++i) {
    const std::uint64_t z = mix64((seed << 32) + static_cast<std::uint64_t>(i + 1) * kGolden64);
    const double unit = static_cast<double>(z >> 11) * 0x1p-53;
    t.data()[i] = static_cast<real>(low + (high - low) * unit);
  }
  return t;
}

inline bool same_bytes(const Tensor& a, const Tensor& b) {
  return a.size() == b.size() &&
         std::memcmp(a.data(), b.data(), static_cast<std::size_t>(a.size()) * sizeof(real)) == 0;
}

inline Variable parameter(const Tensor& t) { return Variable(t, true); }
inline Variable zeros(const Shape& shape) { return Variable(Tensor::zeros(shape)); }

inline testing::AssertionResult has_values(const Tensor& found, const Shape& shape,
                                           std::initializer_list<double> expected,
                                           double tolerance = kRounding) {
  if (found.shape() != shape) return testing::AssertionFailure() << "found " << found.shape().text();
  if (expected.size() != found.values().size())
    return testing::AssertionFailure() << found.size() << " elements, expected " << expected.size();
  const real* value = found.data();
  for (const double wanted : expected) {
    if (!(std::abs(static_cast<double>(*value) - wanted) <= tolerance * std::max(1.0, std::abs(wanted))))
      return testing::AssertionFailure() << "element " << value - found.data() << " of " << shape.text()
                                         << " is " << *value << ", expected " << wanted;
    ++value;
  }
  return testing::AssertionSuccess();
}

/// A tensor, its shape, its elements {1, 2 ...} and, where rounding is larger than usual, a tolerance.
#define EXPECT_VALUES(...) EXPECT_TRUE(supertac::test::has_values(__VA_ARGS__))

}  // namespace supertac::test
