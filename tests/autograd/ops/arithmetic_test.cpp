// tests/models/networks/ops_parity_test.cpp has the values and gradients of these ops. By their rows in
// apps/check/gradient_cases.cpp `supertac-check gradients` compares these with differences, and
// tests/layers/gradient_test.cpp tries the ops empty and with planted errors.
#include "autograd/ops/arithmetic.h"

#include "tests/autograd/check.h"
#include "tests/support/test.h"

namespace supertac::arithmetic_test {

using namespace test;

TEST(Arithmetic, OneVariableMayBeBothArguments) {
  const Variable x = parameter(Tensor::of({2, 2}, {1, -2, 3, 0}));
  backward(sum(x * x + (x + x)));
  EXPECT_VALUES(x.grad(), {2, 2}, {4, -2, 8, 2});
}

TEST(Arithmetic, SumOfManyKeepsItsDigits) {
  const Dim n = 1'000'003;  // a float accumulator would stop counting at 2^24 / .1
  EXPECT_NEAR(static_cast<double>(sum(Variable(Tensor::full({n}, real(0.1)))).item()), 100000.3, 0.01);
}

TEST(Arithmetic, RefusesOtherShapes) {
  const Variable a(Tensor::zeros({2, 3})), b(Tensor::zeros({3, 2}));
  EXPECT_REFUSAL("add: b expects the shape of a, [2,3], got [3,2]", a + b);
  EXPECT_REFUSAL("multiply: b expects the shape of a, [2,3], got [3,2]", a * b);
  EXPECT_REFUSAL("subtract: b expects the shape of a, [2,3], got [3,2]", a - b);
  EXPECT_REFUSAL("subtract: x expects a value, got an empty Variable", 1 - Variable());
}

}  // namespace supertac::arithmetic_test
