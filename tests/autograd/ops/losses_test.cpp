#include "autograd/ops/losses.h"

#include "tests/autograd/check.h"
#include "tests/support/test.h"

namespace supertac::losses_test {

using namespace test;

TEST(L2Loss, HandComputed) {
  const Variable x = parameter(Tensor::of({2, 2}, {1, 2, 3, 4})),
                 t = parameter(Tensor::of({2, 2}, {1, 0, 4, 8}));
  const Variable loss = l2_loss(x, t);
  EXPECT_NEAR(static_cast<double>(loss.item()), (0 + 4 + 1 + 16) / 4.0, 10 * kRounding);
  backward(loss);
  EXPECT_VALUES(x.grad(), {2, 2}, {0, 1, -0.5, -2});
  EXPECT_VALUES(t.grad(), {2, 2}, {0, -1, 0.5, 2});
}

TEST(L2Loss, RefusesOtherShapes) {
  const Variable a(Tensor::zeros({2, 3})), b(Tensor::zeros({3})), none(Tensor::zeros({0}));
  EXPECT_REFUSAL("l2_loss: target expects the shape of x, [2,3], got [3]", l2_loss(a, b));
  EXPECT_REFUSAL("l2_loss: x expects an element or more, got [0]", l2_loss(none, none));
}

Variable cross_entropy(const Variable& logits, const std::vector<std::int32_t>& labels) {
  return softmax_cross_entropy(logits, labels);
}

TEST(CrossEntropy, HandComputed) {
  const Variable logits = parameter(Tensor::of({2, 2}, {0, 0, real(std::log(3.0)), 0}));
  const Variable loss = cross_entropy(logits, {1, 0});
  EXPECT_NEAR(static_cast<double>(loss.item()), (std::log(2.0) + std::log(4.0 / 3)) / 2, kRounding);
  backward(loss);
  EXPECT_VALUES(logits.grad(), {2, 2}, {0.25, -0.25, -0.125, 0.125});
}

TEST(CrossEntropy, LargeLogitsStayFinite) {
  const Variable logits = parameter(Tensor::of({2, 3}, {10000, 0, -10000, 10000, 0, -10000}));
  const Variable loss = cross_entropy(logits, {0, 2});
  EXPECT_NEAR(static_cast<double>(loss.item()), 10000, 0.01);  // (0 + 20000) / 2
  backward(loss);
  EXPECT_VALUES(logits.grad(), {2, 3}, {0, 0, 0, 0.5, 0, -0.5});
}

TEST(CrossEntropy, RefusesWrongLabels) {
  const Variable logits(Tensor::zeros({2, 3}));
  EXPECT_REFUSAL("softmax_cross_entropy: logits expects rank 2, got [3]", cross_entropy(zeros({3}), {0}));
  EXPECT_REFUSAL("softmax_cross_entropy: labels expects 2 entries, got 1", cross_entropy(logits, {0}));
  EXPECT_REFUSAL("softmax_cross_entropy: labels[1] expects a class in [0,3), got 3",
                 cross_entropy(logits, {0, 3}));
  EXPECT_REFUSAL("softmax_cross_entropy: labels[0] expects a class in [0,3), got -1",
                 cross_entropy(logits, {-1, 0}));
  EXPECT_REFUSAL("softmax_cross_entropy: logits expects a row or more, got [0,3]",
                 cross_entropy(zeros({0, 3}), {}));
}

}  // namespace supertac::losses_test
