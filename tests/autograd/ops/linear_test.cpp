#include "autograd/ops/linear.h"

#include "tests/autograd/check.h"
#include "tests/support/test.h"

namespace supertac::linear_test {

using namespace test;

TEST(Linear, HandComputed) {
  const Variable x(Tensor::of({2, 2}, {1, 2, 3, 4})), w(Tensor::of({2, 3}, {1, 0, -1, 2, 1, 0}));
  const Variable b(Tensor::of({3}, {10, 20, 30}));
  EXPECT_VALUES(linear(x, w, b).value(), {2, 3}, {15, 22, 29, 21, 24, 27});
}

TEST(Linear, RefusesOtherShapes) {
  const Variable x(Tensor::zeros({2, 3})), w(Tensor::zeros({3, 5})), b(Tensor::zeros({5}));
  EXPECT_REFUSAL("linear: x expects rank 2, got [5]", linear(b, w, b));
  EXPECT_REFUSAL("linear: w expects rank 2, got [5]", linear(x, b, b));
  EXPECT_REFUSAL("linear: x expects 5 columns, as w [5,3], got [2,3]", linear(x, zeros({5, 3}), b));
  EXPECT_REFUSAL("linear: b expects [5], got [3]", linear(x, w, zeros({3})));
}

}  // namespace supertac::linear_test
