// What the tests of ops share: numbers to feed in, and one-line checks of values, gradients and messages.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <initializer_list>
#include <stdexcept>
#include <string>
#include <vector>

#include "autograd/gradient_checker.h"
#include "autograd/ops/arithmetic.h"
#include "autograd/tensor.h"
#include "autograd/variable.h"
#include "tests/expect_error.h"

namespace supertac::test {

/// What is left of a hand-computed value after rounding.
inline constexpr double kRounding = sizeof(real) == 4 ? 2e-6 : 1e-14;

/// Irregular numbers in [low, high), a pure function of seed and place (splitmix64).
inline Tensor numbers(const Shape& shape, std::uint64_t seed = 1, double low = -1, double high = 1) {
  Tensor t(shape);
  for (Dim i = 0; i < t.size(); ++i) {
    std::uint64_t z = (seed << 32) + static_cast<std::uint64_t>(i + 1) * 0x9E3779B97F4A7C15U;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9U;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBU;
    const double unit = static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1p-53;
    t.data()[i] = static_cast<real>(low + (high - low) * unit);
  }
  return t;
}

/// The same, but at least .1 from zero, where rectifiers have no derivative.
inline Tensor numbers_off_zero(const Shape& shape, std::uint64_t seed = 1) {
  Tensor t = numbers(shape, seed);
  for (real& x : t.values()) x += static_cast<real>(x < 0 ? -0.1 : 0.1);
  return t;
}

inline bool same_bytes(const Tensor& a, const Tensor& b) {
  return a.size() == b.size() &&
         std::memcmp(a.data(), b.data(), static_cast<std::size_t>(a.size()) * sizeof(real)) == 0;
}

inline Variable parameter(const Tensor& t) { return Variable(t, true); }

/// A line of a test; std::source_location is more than Clang 14 can do with this standard library.
struct Place {
  const char* file;
  int line;
  static Place current(const char* file = __builtin_FILE(), int line = __builtin_LINE()) {
    return {file, line};
  }
};

/// What fails below names the line of the test that asked.
class At {
 public:
  explicit At(const Place& place) : trace_(place.file, place.line, "asked for here") {}

 private:
  testing::ScopedTrace trace_;
};

inline void expect_values(const Tensor& found, const Shape& shape, std::initializer_list<double> expected,
                          double tolerance = kRounding, const Place& place = Place::current()) {
  const At at(place);
  ASSERT_EQ(found.shape().text(), shape.text());
  ASSERT_EQ(static_cast<std::size_t>(found.size()), expected.size());
  Dim i = 0;
  for (const double value : expected) {
    EXPECT_NEAR(static_cast<double>(found.data()[i]), value, tolerance * std::max(1.0, std::abs(value)))
        << "element " << i;
    ++i;
  }
}

/// `action` must throw std::invalid_argument with exactly this text.
inline void expect_refusal(const std::string& text, const std::function<void()>& action,
                           const Place& place = Place::current()) {
  const At at(place);
  EXPECT_EQ(what_of<std::invalid_argument>(action), text);
}

inline double dot(const Tensor& a, const Tensor& b) {
  double total = 0;
  for (Dim i = 0; i < a.size(); ++i) {
    total += static_cast<double>(a.data()[i]) * static_cast<double>(b.data()[i]);
  }
  return total;
}

}  // namespace supertac::test
