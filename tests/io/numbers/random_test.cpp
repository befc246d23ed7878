#include "io/numbers/random.h"

#include "tests/support/test.h"

namespace supertac::random_test {

using Words = std::array<std::uint32_t, 4>;

TEST(Random, PhiloxGivesThePublishedNumbers) {  // kat_vectors of Random123
  constexpr std::uint32_t f = 0xffffffff;
  EXPECT_EQ(philox({0, 0, 0, 0}, {0, 0}), (Words{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  EXPECT_EQ(philox({f, f, f, f}, {f, f}), (Words{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
  EXPECT_EQ(philox({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
            (Words{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

TEST(Random, InverseNormalIsTheInverse) {
  for (const double p : {1e-300, 1e-20, 1e-9, 0.001, 0.0749, 0.0751, 0.3, 0.5, 0.7, 0.9249, 0.9251, 0.999}) {
    const double x = inverse_normal(p);
    EXPECT_NEAR(0.5 * std::erfc(-x / std::sqrt(2.0)) / p, 1.0, 1e-12) << p;
  }
  EXPECT_EQ(inverse_normal(0.5), 0.0);
  EXPECT_NEAR(inverse_normal(0.975), 1.959963984540054, 1e-15);
  for (const double p : {0.0, 1.0, -1.0, std::nan("")}) EXPECT_TRUE(std::isnan(inverse_normal(p)));
}

TEST(Random, UniformAndNormalHaveTheirMoments) {
  const RandomStream stream(7, 3);
  constexpr int kCount = 200'000;
  double mean = 0, square = 0, uniform = 0, fourth = 0;
  for (int i = 0; i < kCount; ++i) {
    const double x = stream.normal(i);
    const double u = stream.uniform(i);
    ASSERT_TRUE(u >= 0 && u < 1);
    mean += x / kCount;
    square += x * x / kCount;
    fourth += x * x * x * x / kCount;
    uniform += u / kCount;
  }
  EXPECT_NEAR(mean, 0, 0.01);  // 4.5 standard errors
  EXPECT_NEAR(square, 1, 0.015);
  EXPECT_NEAR(fourth, 3, 0.1);
  EXPECT_NEAR(uniform, 0.5, 0.003);
}

TEST(Random, DependsOnSeedStreamAndCounterOnly) {
  EXPECT_EQ(RandomStream(1, 2).bits(3), RandomStream(1, 2).bits(3));
  EXPECT_NE(RandomStream(1, 2).bits(3), RandomStream(2, 2).bits(3));
  EXPECT_NE(RandomStream(1, 2).bits(3), RandomStream(1, 3).bits(3));
  EXPECT_NE(RandomStream(1, 2).bits(3), RandomStream(1, 2).bits(4));
  EXPECT_NE(RandomStream(1, 2).bits(3), RandomStream(1, 2).bits(3 + (std::uint64_t{1} << 32)));
  EXPECT_NE(RandomStream(1, 2).bits(3), RandomStream(1 + (std::uint64_t{1} << 32), 2).bits(3));
}

}  // namespace supertac::random_test
