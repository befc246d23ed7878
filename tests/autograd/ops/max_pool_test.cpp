#include "autograd/ops/max_pool.h"

#include <cmath>
#include <limits>

#include "autograd/ops/arithmetic.h"
#include "tests/autograd/check.h"

namespace supertac {
namespace {

using namespace test;

TEST(MaxPool, HandComputedAndAnOddRowIsLeftOut) {
  const Variable x = parameter(Tensor::of({1, 3, 4, 1}, {1, 5, 2, 2, 3, 4, 2, 2, 9, 9, 9, 9}));
  const Variable y = max_pool2d(x);
  expect_values(y.value(), {1, 1, 2, 1}, {5, 2});
  backward(sum(y));  // among equal values the first gets the gradient, once
  expect_values(x.grad(), {1, 3, 4, 1}, {0, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0});
}

TEST(MaxPool, ANanComesOutWhereverItLies) {
  for (Dim at = 0; at < 4; ++at) {
    Tensor x = Tensor::of({1, 2, 2, 1}, {1, 5, 2, 7});
    x.data()[at] = std::numeric_limits<real>::quiet_NaN();
    EXPECT_TRUE(std::isnan(max_pool2d(Variable(x)).item())) << "element " << at;
  }
}

TEST(MaxPool, Empty) {
  const Variable x = parameter(Tensor::zeros({0, 4, 6, 2})), y = max_pool2d(x);
  EXPECT_EQ(y.shape().text(), "[0,2,3,2]");
  backward(sum(y));
  EXPECT_EQ(x.grad().shape().text(), "[0,4,6,2]");
}

TEST(MaxPool, RefusesOtherShapes) {
  expect_refusal("max_pool2d: x expects rank 4, got [4,4]", [] {
    max_pool2d(Variable(Tensor::zeros({4, 4})));
  });
  expect_refusal("max_pool2d: x must be at least 2x2, got [1,1,4,3]", [] {
    max_pool2d(Variable(Tensor::zeros({1, 1, 4, 3})));
  });
}

}  // namespace
}  // namespace supertac
