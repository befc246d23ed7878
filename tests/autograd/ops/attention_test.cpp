#include "autograd/ops/attention.h"

#include "autograd/ops/arithmetic.h"
#include "tests/autograd/check.h"
#include "tests/support/test.h"

namespace supertac::attention_test {

using namespace test;

TEST(Attention, HandComputed) {
  const Variable x(Tensor::of({1, 2, 2, 2}, {1, 10, 2, 20, 3, 30, 6, 0}));
  EXPECT_VALUES(global_mean(x).value(), {1, 2}, {3, 15});
  const Variable a(Tensor::of({1, 2, 2, 2}, {100, 0, 0, 0, 0, 0, 0, 5})), s(Tensor::of({1, 2}, {2, -1}));
  EXPECT_VALUES(gated_sum(a, x, s).value(), {1, 2, 2, 2}, {102, -10, 4, -20, 6, -30, 12, 5});
}

// No pixels, but gates: their gradients are sums of nothing.
TEST(Attention, OfNoPixels) {
  const Variable flat = parameter(Tensor::zeros({2, 0, 4, 3})), gates = parameter(numbers({2, 3}));
  backward(sum(gated_sum(flat, flat, gates)));
  EXPECT_TRUE(same_bytes(gates.grad(), Tensor::zeros({2, 3})));
}

TEST(Attention, RefusesOtherShapes) {
  const Variable x(Tensor::zeros({2, 4, 4, 3})), flat(Tensor::zeros({2, 3}));
  EXPECT_REFUSAL("global_mean: x expects rank 4, got [2,3]", global_mean(flat));
  EXPECT_REFUSAL("global_mean: x expects a pixel or more, got [2,0,4,3]", global_mean(zeros({2, 0, 4, 3})));
  EXPECT_REFUSAL("gated_sum: x expects rank 4, got [2,3]", gated_sum(flat, flat, flat));
  EXPECT_REFUSAL("gated_sum: a expects the shape of x, [2,4,4,3], got [2,3]", gated_sum(flat, x, flat));
  EXPECT_REFUSAL("gated_sum: s expects [2,3], got [3,2]", gated_sum(x, x, zeros({3, 2})));
}

}  // namespace supertac::attention_test
