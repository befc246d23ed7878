#include "autograd/ops/shaping.h"

#include "autograd/ops/arithmetic.h"
#include "tests/autograd/check.h"
#include "tests/support/test.h"

namespace supertac::shaping_test {

using namespace test;

Variable joined(const std::vector<Variable>& xs) { return concat(xs); }
Variable unflattened(const Variable& x, std::initializer_list<Dim> pixels) {
  return unflatten_channels_first(x, std::span<const Dim>(pixels.begin(), pixels.size()));
}

TEST(Shaping, HandComputed) {
  const Variable x(Tensor::of({2, 3}, {1, 2, 3, 4, 5, 6})), y(Tensor::of({2, 1}, {7, 8}));
  EXPECT_VALUES(joined({x, y}).value(), {2, 4}, {1, 2, 3, 7, 4, 5, 6, 8});
  const Variable pixels(Tensor::of({1, 2, 3}, {1, 10, 100, 2, 20, 200}));  // [N,L,C]
  EXPECT_VALUES(flatten_channels_first(pixels).value(), {1, 6}, {1, 2, 10, 20, 100, 200});
}

TEST(Shaping, UnflattenUndoesFlatten) {
  const Tensor x = numbers({2, 3, 5, 4});
  const Variable back = unflattened(flatten_channels_first(Variable(x)), {3, 5});
  EXPECT_EQ(back.shape().text(), "[2,3,5,4]");
  EXPECT_TRUE(same_bytes(back.value(), x));
}

TEST(Shaping, OneAxisIsEnoughToJoin) {
  const Variable joint = joined({Variable(Tensor::of({2}, {1, 2})), Variable(Tensor::of({1}, {3}))});
  EXPECT_VALUES(joint.value(), {3}, {1, 2, 3});
}

TEST(Shaping, Empty) {
  const Variable x(Tensor::zeros({0, 3, 2}));
  EXPECT_EQ(take_runs(x, {0, 1, 1, 2}).shape().text(), "[0,3,2]");
  EXPECT_EQ(last_frame(x, 1, 2, 1).shape().text(), "[0,1,2,1]");
  const Variable none = parameter(Tensor::zeros({2, 0})), some = parameter(numbers({2, 3}));
  backward(sum(joined({none, some, none})));
  EXPECT_EQ(none.grad().shape().text(), "[2,0]");
  EXPECT_TRUE(same_bytes(some.grad(), Tensor::full({2, 3}, 1)));
}

TEST(Shaping, TakesRunsOfColumns) {
  const Variable x(Tensor::of({2, 6}, {0, 1, 2, 3, 4, 5, 10, 11, 12, 13, 14, 15}));
  const Variable y = take_runs(x, {.first = 1, .run = 2, .step = 3, .width = 4});
  EXPECT_VALUES(y.value(), {2, 4}, {1, 2, 4, 5, 11, 12, 14, 15});
  EXPECT_REFUSAL("take_runs: x expects columns for all runs, got [2,6]", take_runs(x, {2, 2, 3, 4}));
  constexpr Dim kHuge = std::numeric_limits<Dim>::max();
  EXPECT_REFUSAL("take_runs: first expects 0 to 6, got -1", take_runs(x, {-1, 2, 3, 4}));
  EXPECT_REFUSAL("take_runs: first expects 0 to 6, got " + std::to_string(kHuge),
                 take_runs(x, {kHuge, 2, 3, 4}));
  EXPECT_REFUSAL("take_runs: run expects 1 to 6, got 0", take_runs(x, {0, 0, 3, 4}));
  EXPECT_REFUSAL("take_runs: step expects 2 or more, got 1", take_runs(x, {0, 2, 1, 4}));
  EXPECT_REFUSAL("take_runs: x expects columns for all runs, got [2,6]", take_runs(x, {0, 2, kHuge, 4}));
  EXPECT_REFUSAL("take_runs: width expects 2 to 6, got " + std::to_string(kHuge - 1),
                 take_runs(x, {0, 2, 2, kHuge - 1}));
  EXPECT_REFUSAL("take_runs: width expects a multiple of run, 2, got 3", take_runs(x, {0, 2, 2, 3}));
  EXPECT_REFUSAL("take_runs: x expects a value, got an empty Variable", take_runs(Variable(), {0, 1, 1, 1}));
  EXPECT_REFUSAL("take_runs: x expects rank 1 or more, got []", take_runs(zeros({}), {0, 1, 1, 1}));
  EXPECT_REFUSAL("take_runs: x expects a constant, got a variable that requires a gradient",
                 take_runs(Variable(Tensor::zeros({2, 6}), true), {0, 2, 2, 4}));
}

TEST(Shaping, TakesTheLastFrameOfEachWindow) {
  const Variable x(Tensor::of({2, 2, 2}, {0, 1, 2, 3, 10, 11, 12, 13}));
  EXPECT_VALUES(last_frame(x, 1, 2, 1).value(), {2, 1, 2, 1}, {2, 3, 12, 13});
  EXPECT_REFUSAL("last_frame: windows expects rank 3, got [2,4]", last_frame(zeros({2, 4}), 1, 2, 1));
  EXPECT_REFUSAL("last_frame: windows expects [2,2,1], got [2,2,2]", last_frame(x, 1, 1, 1));
  for (const Shape& empty : {Shape{2, 0, 2}, {2, 2, 0}})
    EXPECT_REFUSAL("last_frame: windows expects [N,T,S] with T, S >= 1, got " + empty.text(),
                   last_frame(zeros(empty), 1, 2, 1));
  EXPECT_REFUSAL("last_frame: windows expects a value, got an empty Variable",
                 last_frame(Variable(), 1, 2, 1));
  EXPECT_REFUSAL("last_frame: rows expects 1 to 2, got 4294967296",
                 last_frame(x, Dim{1} << 32, Dim{1} << 32, 1));
  EXPECT_REFUSAL("last_frame: columns expects 1 to 2, got -2", last_frame(x, 1, -2, 1));
  EXPECT_REFUSAL("last_frame: channels expects 1 to 1, got 0", last_frame(x, 1, 2, 0));
  EXPECT_REFUSAL("last_frame: windows expects a constant, got a variable that requires a gradient",
                 last_frame(Variable(Tensor::zeros({1, 2, 2}), true), 1, 2, 1));
}

TEST(Shaping, RefusesWhatDoesNotFit) {
  const Variable x(Tensor::zeros({2, 3})), scalar(Tensor::zeros({}));
  EXPECT_REFUSAL("concat: xs expects 1 to 8 inputs, got 0", joined({}));
  EXPECT_REFUSAL("concat: xs expects 1 to 8 inputs, got 9", joined(std::vector<Variable>(9, x)));
  EXPECT_REFUSAL("concat: x0 expects rank 1 or more, got []", joined({scalar}));
  EXPECT_REFUSAL("concat: x1 expects rank 2, got []", joined({x, scalar}));
  EXPECT_REFUSAL("concat: x1 expects [2,4], got [3,4]", joined({x, zeros({3, 4})}));
  EXPECT_REFUSAL("flatten_channels_first: x expects rank 3 or 4, got [2,3]", flatten_channels_first(x));
  EXPECT_REFUSAL("unflatten_channels_first: x expects rank 2, got []", unflattened(scalar, {1}));
  EXPECT_REFUSAL("unflatten_channels_first: pixels expects {L} or {H,W}, got 3 sizes",
                 unflattened(x, {1, 1, 1}));
  EXPECT_REFUSAL("unflatten_channels_first: x expects a multiple of 2 columns, got [2,3]",
                 unflattened(x, {2}));
  EXPECT_REFUSAL("unflatten_channels_first: pixels expects 1 to 1073741824, got -3",
                 unflattened(x, {-3, -1}));
  EXPECT_REFUSAL("unflatten_channels_first: pixels expects 1 to 1073741824, got 4294967296",
                 unflattened(x, {Dim{1} << 32, Dim{1} << 32}));
}

TEST(MaxPool, HandComputedAndAnOddRowIsLeftOut) {
  const Variable x = parameter(Tensor::of({1, 3, 4, 1}, {1, 5, 2, 2, 3, 4, 2, 2, 9, 9, 9, 9}));
  const Variable y = max_pool2d(x);
  EXPECT_VALUES(y.value(), {1, 1, 2, 1}, {5, 2});
  backward(sum(y));  // among equal values the first gets the gradient, once
  EXPECT_VALUES(x.grad(), {1, 3, 4, 1}, {0, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0});
}

TEST(MaxPool, ANanComesOutWhereverItLies) {
  for (Dim at = 0; at < 4; ++at) {
    Tensor x = Tensor::of({1, 2, 2, 1}, {1, 5, 2, 7});
    x.data()[at] = std::numeric_limits<real>::quiet_NaN();
    EXPECT_TRUE(std::isnan(max_pool2d(Variable(x)).item())) << "element " << at;
  }
}

TEST(MaxPool, RefusesOtherShapes) {
  EXPECT_REFUSAL("max_pool2d: x expects rank 4, got [4,4]", max_pool2d(zeros({4, 4})));
  EXPECT_REFUSAL("max_pool2d: x expects H, W >= 2, got [1,1,4,3]", max_pool2d(zeros({1, 1, 4, 3})));
}

}  // namespace supertac::shaping_test
