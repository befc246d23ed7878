#include "autograd/kernels/exp.h"

#include "tests/support/test.h"

namespace supertac::kernels {
namespace {

TEST(Exp, RelativeErrorIsAsDocumented) {
  double worst = 0;
  for (int i = -86'999; i < 88'000; ++i) {
    const float x = static_cast<float>(i) * 1e-3F;
    const double exact = std::exp(static_cast<double>(x));
    worst = std::max(worst, std::abs(static_cast<double>(exp_same_bits(x)) / exact - 1));
  }
  EXPECT_LT(worst, 2e-7);
}

TEST(Exp, Limits) {
  EXPECT_EQ(exp_same_bits(0.0F), 1.0F);
  EXPECT_TRUE(std::isnormal(exp_same_bits(-1e30F)));
  EXPECT_TRUE(std::isfinite(exp_same_bits(1e30F)));
  EXPECT_EQ(exp_same_bits(std::numeric_limits<float>::infinity()), exp_same_bits(88.0F));
  EXPECT_TRUE(std::isnan(exp_same_bits(std::numeric_limits<float>::quiet_NaN())));
}

TEST(Sigmoid, IsSymmetricAndMonotone) {
  float before = 0;
  for (int i = -4000; i <= 4000; ++i) {
    const float x = static_cast<float>(i) * 1e-2F, s = sigmoid_same_bits(x);
    EXPECT_NEAR(static_cast<double>(s + sigmoid_same_bits(-x)), 1, 2e-7);
    EXPECT_GE(s, before);
    before = s;
  }
}

}  // namespace
}  // namespace supertac::kernels
