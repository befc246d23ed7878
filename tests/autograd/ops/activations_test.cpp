#include "autograd/ops/activations.h"

#include "autograd/ops/arithmetic.h"
#include "tests/autograd/check.h"

namespace supertac {
namespace {

using namespace test;

TEST(Activations, HandComputed) {
  const Variable x(Tensor::of({4}, {-2, -0.5, 0, 3}));
  expect_values(relu(x).value(), {4}, {0, 0, 0, 3});
  expect_values(leaky_relu(x).value(), {4}, {-0.02, -0.005, 0, 3});
  expect_values(leaky_relu(x, real(0.5)).value(), {4}, {-1, -0.25, 0, 3});
  expect_values(sigmoid(x).value(), {4}, {0.11920292202211755, 0.3775406687981454, 0.5, 0.9525741268224334});
  expect_values(clamp(x, -1, 1).value(), {4}, {-1, -0.5, 0, 1});
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
  expect_values(x.grad(), {5}, {0, 1, 1, 1, 0});
}

TEST(Activations, NotANumberStaysVisible) {
  const Variable x(Tensor::full({1}, std::numeric_limits<real>::quiet_NaN()));
  for (const Variable& y : {relu(x), leaky_relu(x), sigmoid(x), clamp(x, -1, 1)})
    EXPECT_TRUE(std::isnan(y.item()));
}

TEST(Activations, Empty) {
  const Variable x(Tensor::zeros({0, 4}));
  for (const Variable& y : {relu(x), leaky_relu(x), sigmoid(x), clamp(x, -1, 1)}) EXPECT_EQ(y.size(), 0);
}

TEST(Activations, RefusesBadSettings) {
  const Variable x(Tensor::zeros({1}));
  expect_refusal("leaky_relu: slope must not be negative, got -0.500000", [&] { leaky_relu(x, real(-0.5)); });
  expect_refusal("clamp: low must not exceed high, got 2.000000 and 1.000000", [&] { clamp(x, 2, 1); });
}

#ifdef SUPERTAC_REAL_IS_DOUBLE
TEST(Activations, Gradients) {
  for (const Shape& shape : {Shape{2, 5, 3, 17}, Shape{33}, Shape{1, 1}}) {
    const Tensor x = numbers_off_zero(shape);
    expect_gradients([](const auto& in) { return relu(in[0]); }, {x});
    expect_gradients([](const auto& in) { return leaky_relu(in[0]); }, {x});
    expect_gradients([](const auto& in) { return sigmoid(in[0]); }, {x});
    expect_gradients([](const auto& in) { return clamp(in[0], -5, 5); }, {x});
  }
}
#endif

}  // namespace
}  // namespace supertac
