#include "autograd/ops/arithmetic.h"

#include "tests/autograd/check.h"
#include "tests/support/test.h"

namespace supertac::arithmetic_test {

using namespace test;

const Tensor kA = Tensor::of({2, 2}, {1, -2, 3, 0}), kB = Tensor::of({2, 2}, {5, 7, -1, 4});

TEST(Arithmetic, HandComputed) {
  EXPECT_VALUES((Variable(kA) + Variable(kB)).value(), {2, 2}, {6, 5, 2, 4});
  EXPECT_VALUES((Variable(kA) * Variable(kB)).value(), {2, 2}, {5, -14, -3, 0});
  EXPECT_VALUES((Variable(kA) - Variable(kB)).value(), {2, 2}, {-4, -9, 4, -4});
  EXPECT_VALUES((-2 * Variable(kA)).value(), {2, 2}, {-2, 4, -6, 0});
  EXPECT_VALUES((1 - Variable(kA)).value(), {2, 2}, {0, 3, -2, 1});
  EXPECT_VALUES(sum(Variable(kA)).value(), {}, {2});
}

TEST(Arithmetic, OneVariableMayBeBothArguments) {
  const Variable x = parameter(kA);
  backward(sum(x * x + (x + x)));
  EXPECT_VALUES(x.grad(), {2, 2}, {4, -2, 8, 2});
}

TEST(Arithmetic, SumOfManyKeepsItsDigits) {
  const Dim n = 1'000'003;  // a float accumulator would stop counting at 2^24 / 0.1
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
