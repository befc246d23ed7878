#include "autograd/ops/activations.h"

#include "autograd/kernels/exp.h"
#include "autograd/ops/arithmetic.h"
#include "autograd/ops/convolution.h"
#include "autograd/ops/linear.h"
#include "tests/autograd/check.h"
#include "tests/support/test.h"

namespace supertac::activations_test {

using namespace test;
using kernels::exp_same_bits, kernels::sigmoid_same_bits;

TEST(Activations, HandComputed) {
  const Variable x(Tensor::of({4}, {-2, -0.5, 0, 3}));
  EXPECT_VALUES(relu(x).value(), {4}, {0, 0, 0, 3});
  EXPECT_VALUES(leaky_relu(x).value(), {4}, {-0.02, -0.005, 0, 3});
  EXPECT_VALUES(leaky_relu(x, real(0.5)).value(), {4}, {-1, -0.25, 0, 3});
  EXPECT_VALUES(sigmoid(x).value(), {4}, {0.11920292202211755, 0.3775406687981454, 0.5, 0.9525741268224334});
  EXPECT_VALUES(clamp(x, -1, 1).value(), {4}, {-1, -0.5, 0, 1});
}

TEST(Activations, SigmoidNeverOverflows) {
  const Variable x = parameter(Tensor::of({4}, {-1000, -80, 80, 1000}));
  const Variable y = sigmoid(x);
  EXPECT_NEAR(static_cast<double>(y.value().data()[0]), 0, 1e-30);
  EXPECT_EQ(y.value().data()[3], 1);
  backward(sum(y));
  for (const real g : x.grad().values()) EXPECT_TRUE(std::isfinite(g) && g >= 0 && g < 1e-30);
}

// log_var beyond the limits gets no gradient; on a limit it does, or it could never come back.
TEST(Activations, ClampGradientStopsOutsideTheLimits) {
  const Variable x = parameter(Tensor::of({5}, {-11, -10, 0, 10, real(10.001)}));
  backward(sum(clamp(x, -10, 10)));
  EXPECT_VALUES(x.grad(), {5}, {0, 1, 1, 1, 0});
}

TEST(Activations, NotANumberStaysVisible) {
  const Variable x(Tensor::full({1}, std::numeric_limits<real>::quiet_NaN()));
  for (const Variable& y : {relu(x), leaky_relu(x), sigmoid(x), clamp(x, -1, 1)})
    EXPECT_TRUE(std::isnan(y.item()));
}

// 0 times infinity is NaN.
TEST(Activations, MinusInfinityIsRectifiedToZero) {
  const Tensor least = Tensor::full({1}, -std::numeric_limits<real>::infinity());
  EXPECT_EQ(relu(Variable(least)).item(), 0);
  EXPECT_EQ(leaky_relu(Variable(least)).item(), -std::numeric_limits<real>::infinity());
  for (const Dim out : {1, 5, 16, 40}) {  // paths of few outputs, of partial vectors, of whole ones
    const Variable b(Tensor::full({out}, -std::numeric_limits<real>::infinity()));
    const Variable y = linear(Variable(numbers({3, 8})), Variable(numbers({8, out}, 2)), b, kRelu);
    for (const real at : y.value().values()) EXPECT_EQ(at, 0) << out;
    for (const Dim side : {5, 8}) {  // eight pixels a side go through Winograd's transform
      const Variable x(numbers({4, side, side, 32})), w(numbers({3, 3, 32, out}, 2));
      const Variable map = conv2d(x, w, b, {.padding = 1, .negative_slope = kRelu});
      for (const real at : map.value().values()) ASSERT_EQ(at, 0) << out << ' ' << side;
    }
  }
}

TEST(Activations, AndOpsThatEndInOneRefuseBadSettings) {
  const Variable x(Tensor::zeros({2, 3})), w(Tensor::zeros({3, 5})), b(Tensor::zeros({5}));
  EXPECT_REFUSAL("leaky_relu: negative_slope expects 0 or more, got -0.5", leaky_relu(x, real(-0.5)));
  EXPECT_REFUSAL("clamp: low expects at most high, 1, got 2", clamp(x, 2, 1));
  EXPECT_REFUSAL("linear: negative_slope expects 0 or more, got -0.5", linear(x, w, b, real(-0.5)));
  const Variable line(Tensor::zeros({1, 4, 3})), taps(Tensor::zeros({3, 3, 5}));
  EXPECT_REFUSAL("conv1d: negative_slope expects 0 or more, got -0.5",
                 conv1d(line, taps, b, {.padding = 1, .negative_slope = real(-0.5)}));
}

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

}  // namespace supertac::activations_test
