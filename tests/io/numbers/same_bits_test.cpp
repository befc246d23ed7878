#include "io/numbers/same_bits.h"

#include "io/numbers/random.h"
#include "tests/support/test.h"

namespace supertac::same_bits_test {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Largest error over 20,000 places of [low, high], against the C library in long double; relative to the
/// value, or to `least` where that is larger (there the reference knows no better).
template <class Ours, class Theirs>
double worst(double low, double high, Ours ours, Theirs theirs, long double least = 0) {
  const RandomStream random(5, 17);
  double worst = 0;
  for (std::uint64_t i = 0; i < 20'000; ++i) {
    const double x = low + (high - low) * random.uniform(i);
    const long double expected = theirs(static_cast<long double>(x));
    worst = std::max(worst,
                     static_cast<double>(std::abs(ours(x) - expected) / std::max(least, std::abs(expected))));
  }
  return worst;
}

TEST(SameBits, AgreesWithTheCLibrary) {
  const auto exp = [](long double x) { return std::exp(x); };
  const auto log = [](long double x) { return std::log(x); };
  for (const double reach : {1e-3, 1.0, 20.0, 708.0})
    EXPECT_LT(worst(-reach, reach, same_bits::exp, exp), 1e-15);
  for (const double reach : {2.0, 1e9, 1e300}) EXPECT_LT(worst(1e-300, reach, same_bits::log, log), 1e-15);
  EXPECT_LT(worst(0.9999, 1.0001, same_bits::log, log), 1e-15);
  EXPECT_LT(worst(
                0.002, 1, [](double x) { return same_bits::pow(x, 1 / 2.4); },
                [](long double x) { return std::pow(x, static_cast<long double>(1 / 2.4)); }),
            1e-15);
}

TEST(SameBits, TurnsAreExactFarFromZero) {
  const auto angle = [](long double turns) { return 2 * std::numbers::pi_v<long double> * turns; };
  const auto cosine = [&](long double turns) { return std::cos(angle(turns)); };
  const auto sine = [&](long double turns) { return std::sin(angle(turns)); };
  for (const double middle : {0.0, 0.125, 0.25, 0.5, -0.75}) {
    EXPECT_LT(worst(middle - 0.2, middle + 0.2, same_bits::cosine, cosine, 1e-3L), 1e-15) << middle;
    EXPECT_LT(worst(middle - 0.2, middle + 0.2, same_bits::sine, sine, 1e-3L), 1e-15) << middle;
  }
  for (const double turns : {0.0, 0.0625, 0.25, 0.3125, 0.5, 0.875}) {
    EXPECT_EQ(same_bits::cosine(turns), same_bits::cosine(turns + 1048576)) << turns;
    EXPECT_EQ(same_bits::sine(turns), same_bits::sine(turns - 1048576)) << turns;
  }
  for (const double little : {1e-9, 1e-300})
    EXPECT_NEAR(same_bits::sine(little) / (2 * std::numbers::pi * little), 1, 1e-15);
  EXPECT_EQ(same_bits::cosine(0.25 + 0x1p-40), -same_bits::sine(0x1p-40));
  EXPECT_EQ(same_bits::cosine(0.25), 0);
  EXPECT_EQ(same_bits::sine(0.5), 0);
}

TEST(SameBits, EndsOfTheirRanges) {
  EXPECT_EQ(same_bits::exp(0), 1);
  EXPECT_EQ(same_bits::exp(710), kInfinity);
  EXPECT_EQ(same_bits::exp(-709), 0);
  EXPECT_NEAR(same_bits::exp(709.7) / std::exp(709.7), 1, 1e-15);
  EXPECT_EQ(same_bits::log(1), 0);
  EXPECT_EQ(same_bits::log(0), -kInfinity);
  EXPECT_EQ(same_bits::log(kInfinity), kInfinity);
  EXPECT_NEAR(same_bits::log(5e-324) / std::log(5e-324), 1, 1e-15);
  EXPECT_EQ(same_bits::pow(0, 0.5), 0);
  for (const double bad : {-1.0, -kInfinity, std::nan("")}) EXPECT_TRUE(std::isnan(same_bits::log(bad)));
  EXPECT_TRUE(std::isnan(same_bits::exp(std::nan(""))));
}

TEST(SameBits, BitsAreThese) {
  EXPECT_EQ(same_bits::exp(1), 0x1.5bf0a8b14576ap+1);
  EXPECT_EQ(same_bits::log(10), 0x1.26bb1bbb55515p+1);
  EXPECT_EQ(same_bits::cosine(0.1), 0x1.9e3779b97f4a8p-1);
  EXPECT_EQ(same_bits::sine(0.1), 0x1.2cf2304755a5ep-1);
}

TEST(SameBits, RoughOnesAreNear) {
  for (double turns = -1; turns < 2; turns += 0.01)
    EXPECT_NEAR(same_bits::rough_sine(turns), std::sin(2 * std::numbers::pi * turns), 2e-4) << turns;
  EXPECT_EQ(same_bits::bell(0, 2), 1);
  EXPECT_EQ(same_bits::bell(8, 2), 0);
  EXPECT_NEAR(same_bits::bell(-2, 2), std::exp(-0.5), 0.011);
}

}  // namespace supertac::same_bits_test
