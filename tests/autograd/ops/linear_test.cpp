// tests/models/networks/ops_parity_test.cpp has the values and gradients of these ops. By their rows in
// apps/check/gradient_cases.cpp `supertac-check gradients` compares these with differences, and
// tests/layers/gradient_test.cpp tries the ops empty and with planted errors.
#include "autograd/ops/linear.h"

#include "autograd/ops/arithmetic.h"
#include "tests/autograd/check.h"
#include "tests/support/test.h"

namespace supertac::linear_test {

using namespace test;

TEST(Linear, RefusesOtherShapes) {
  const Variable x(Tensor::zeros({2, 3})), w(Tensor::zeros({3, 5})), b(Tensor::zeros({5}));
  EXPECT_REFUSAL("linear: x expects a value, got an empty Variable",
                 linear(Variable(), Variable(), Variable()));
  EXPECT_REFUSAL("linear: x expects rank 2, got [5]", linear(b, w, b));
  EXPECT_REFUSAL("linear: w expects rank 2, got [5]", linear(x, b, b));
  EXPECT_REFUSAL("linear: x expects 5 columns, as w [5,3], got [2,3]", linear(x, zeros({5, 3}), b));
  EXPECT_REFUSAL("linear: b expects [5], got [3]", linear(x, w, zeros({3})));
}

}  // namespace supertac::linear_test
