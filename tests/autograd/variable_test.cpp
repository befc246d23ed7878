#include "autograd/variable.h"

#include <thread>

#include "autograd/ops/activations.h"
#include "autograd/ops/arithmetic.h"
#include "autograd/ops/convolution.h"
#include "autograd/ops/shaping.h"
#include "autograd/record.h"
#include "autograd/trace.h"
#include "tests/autograd/check.h"
#include "tests/support/test.h"

namespace supertac::variable_test {

using test::parameter;

TEST(Backward, AddsUpBothSidesOfADiamond) {
  const Variable x = parameter(Tensor::of({2}, {3, -2}));
  const Variable square = x * x;
  backward(sum(square * x + 2 * square));  // x^3 + 2 x^2
  EXPECT_VALUES(x.grad(), {2}, {27 + 12, 12 - 8});
}

// Each level uses the one below twice: a visitor that follows paths would take 2^60 steps.
TEST(Backward, VisitsEveryNodeOnce) {
  const Variable x = parameter(Tensor::full({}, 1));
  Variable y = x;
  for (int i = 0; i < 60; ++i) y = real(0.5) * (y + y);
  backward(y);
  EXPECT_EQ(x.grad().item(), 1);
}

TEST(Backward, ALongSkipWaitsForTheLongWay) {
  const Variable x = parameter(Tensor::full({}, 2));
  const Variable early = x * x;  // used at once and 50 ops later
  Variable late = early;
  for (int i = 0; i < 50; ++i) late = 1 * late;
  backward(late * early);  // x^4
  EXPECT_EQ(x.grad().item(), 32);
}

TEST(Backward, GradientsOfLeavesAccumulate) {
  const Variable x = parameter(Tensor::full({}, 3));
  backward(2 * x);
  backward(5 * x);
  EXPECT_EQ(x.grad().item(), 7);
  backward(x);  // dx/dx = 1
  EXPECT_EQ(x.grad().item(), 8);
}

// At its first use a gradient is written (conv2d), or filled with zeros that are added to (max_pool2d).
TEST(Backward, AGradientThatWasTakenAwayIsMadeAnew) {
  Variable w = parameter(Tensor::full({1, 2, 2, 1}, 3));
  const Variable two(Tensor::full({1, 1, 1, 1}, 2)), bias(Tensor::zeros({1}));
  for (const bool by_conv : {true, false, true}) {
    w.mutable_grad() = Tensor();
    backward(sum(by_conv ? conv2d(w, two, bias, {}) : 8 * max_pool2d(w)));  // of equal pixels the first
    ASSERT_EQ(w.grad().data()[0], by_conv ? 2 : 8);
    ASSERT_EQ(w.grad().data()[3], by_conv ? 2 : 0);
  }
}

TEST(Backward, LeavesThatNeedNoGradientGetNone) {
  const Variable x = parameter(Tensor::full({}, 3)), constant(Tensor::full({}, 4));
  backward(x * constant);
  EXPECT_EQ(x.grad().item(), 4);
  EXPECT_FALSE(constant.grad().defined());
}

TEST(Backward, FreesTheGraph) {
  const Variable x = parameter(Tensor::full({2}, 3));
  const Variable middle = 2 * x, loss = sum(middle);
  backward(loss);
  EXPECT_FALSE(middle.grad().defined());
  EXPECT_REFUSAL(
      "backward: loss expects a graph that is whole, got one whose op sum an earlier backward freed; run the "
      "forward pass again",
      backward(loss));
  EXPECT_REFUSAL(
      "backward: loss expects a graph that is whole, got one whose op scale an earlier backward freed; run "
      "the forward pass again",
      backward(sum(middle)));
  const Variable fresh = 3 * x;
  backward(sum(fresh));  // a refused backward leaves nothing in the queue
  EXPECT_VALUES(x.grad(), {2}, {5, 5});
}

TEST(Backward, FreesWhatAReverseStepHolds) {
  const Variable x = parameter(Tensor::full({}, 3));
  const auto held = std::make_shared<int>(1);
  const Variable loss = record("holds", Tensor::full({}, 1), {&x}, [held](Backward&) {});
  EXPECT_EQ(held.use_count(), 2);
  backward(loss);
  EXPECT_EQ(held.use_count(), 1);
}

TEST(Backward, RefusesWhatHasNoGradient) {
  const Variable x = parameter(Tensor::full({2}, 3));
  EXPECT_REFUSAL("backward: loss expects one element, got [2]", backward(1 * x));
  EXPECT_REFUSAL(
      "backward: loss expects a variable that depends on one with a gradient, got one that depends on none",
      backward(sum(Variable(Tensor::full({2}, 3)))));
}

TEST(Backward, AStepThatThrowsLeavesTheLeavesUsable) {
  const Variable x = parameter(Tensor::full({2}, 3));
  const Variable y =
      record("planted", x.value().clone(), {&x}, [](Backward&) { throw std::runtime_error("of the step"); });
  EXPECT_EQ(what_of<std::runtime_error>([&] { backward(sum(2 * y)); }), "of the step");
  backward(sum(2 * x));
  EXPECT_VALUES(x.grad(), {2}, {2, 2});
}

TEST(Backward, RefusesAGradientOfAnotherShape) {
  Variable x = parameter(Tensor::full({2}, 3)), loss = sum(x);
  x.mutable_grad() = Tensor::zeros({1});
  EXPECT_REFUSAL("backward: the gradient of input 0 of sum expects [2], got [1]", backward(loss));
  x.mutable_grad() = Tensor();
  loss = sum(x);
  loss.mutable_grad() = Tensor::zeros({0});
  EXPECT_REFUSAL("backward: the gradient of loss expects [], got [0]", backward(loss));
}

TEST(Trace, OnePerThread) {
  const Trace trace;
  EXPECT_EQ(what_of<std::logic_error>([] { Trace(); }), "Trace: this thread is traced already");
  struct Watch : ReverseWatch {
    void reverse(Backward&, const std::function<void()>& step) override { step(); }
  };
  const Watch watch;
  EXPECT_EQ(what_of<std::logic_error>([] { Watch(); }), "ReverseWatch: this thread is watched already");
}

TEST(Variable, RefusesToBeUsedWithoutAValue) {
  Variable empty;
  const std::function<void()> uses[] = {[&] { empty.shape(); },        [&] { empty.grad(); },
                                        [&] { empty.mutable_grad(); }, [&] { empty.mutable_value(); },
                                        [&] { backward(empty); },      [&] { inputs_of(empty); }};
  for (const auto& use : uses)
    EXPECT_REFUSAL("Variable: its value expects a tensor or an op's result, got an empty Variable", use());
  EXPECT_REFUSAL("Variable: value expects a tensor, got an undefined one", parameter(Tensor()));
  EXPECT_STREQ(Variable().op(), "none");
  EXPECT_STREQ(parameter(Tensor::zeros({1})).op(), "leaf");
}

TEST(NoGrad, ComputesTheSameWithoutRecording) {
  const Variable x = parameter(Tensor::full({}, 3));
  const Variable recorded = x * x;
  {
    const NoGrad outer;
    { const NoGrad inner; }
    const Variable y = x * x;
    EXPECT_EQ(y.item(), recorded.item());
    EXPECT_FALSE(y.requires_grad());
  }
  EXPECT_TRUE((x * x).requires_grad());
}

TEST(NoGrad, HoldsForItsThreadOnly) {
  const NoGrad here;
  bool recorded = false;
  std::thread([&] { recorded = (2 * parameter(Tensor::full({}, 1))).requires_grad(); }).join();
  EXPECT_TRUE(recorded);
}

// 200,000 nodes in a row: neither backward nor the destructors may recurse.
TEST(Variable, LongChainsNeedNoStack) {
  const Variable x = parameter(Tensor::full({}, 1));
  const auto chain = [&] {
    Variable y = x;
    for (int i = 0; i < 200000; ++i) y = 1 * y;
    return y;
  };
  backward(chain());
  EXPECT_EQ(x.grad().item(), 1);
  { const Variable dropped = chain(); }  // never went through backward
  std::thread([held = chain()]() mutable { held = Variable(); }).join();
}

// Creation numbers of two threads may not reverse an edge.
TEST(Backward, AGraphMayBeContinuedOnAnotherThread) {
  const Variable x = parameter(Tensor::full({}, 3));
  for (int i = 0; i < 100; ++i) 1 * x;  // this thread's numbers run ahead of the new thread's
  const Variable square = x * x;
  std::thread([&] { backward(square * (1 * (1 * square))); }).join();  // x^4
  EXPECT_EQ(x.grad().item(), 108);
}

TEST(Record, TakesAtMostEightInputs) {
  const Variable x = parameter(Tensor::full({1}, 1));
  const std::vector<const Variable*> inputs(9, &x);
  EXPECT_REFUSAL("nine: inputs expects at most 8, got 9",
                 record("nine", Tensor::zeros({1}), inputs, [](Backward&) {}));
}

}  // namespace supertac::variable_test
