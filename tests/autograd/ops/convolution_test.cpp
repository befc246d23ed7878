#include "autograd/ops/convolution.h"

#include "tests/autograd/check.h"
#include "tests/support/test.h"

namespace supertac::convolution_test {

using namespace test;

TEST(Conv1d, HandComputed) {
  const Variable x(Tensor::of({1, 4, 1}, {1, 2, 3, 4})), w(Tensor::of({3, 1, 1}, {1, 10, 100}));
  const Variable b(Tensor::of({1}, {1000}));
  EXPECT_VALUES(conv1d(x, w, b, {.padding = 1}).value(), {1, 4, 1}, {1210, 1321, 1432, 1043});
  EXPECT_VALUES(conv1d(x, w, b, {.stride = 2, .padding = 1}).value(), {1, 2, 1}, {1210, 1432});
}

TEST(ConvTranspose1d, HandComputed) {
  const Variable x(Tensor::of({1, 2, 1}, {1, 2})), w(Tensor::of({4, 1, 1}, {1, 10, 100, 1000}));
  const Variable b(Tensor::of({1}, {0}));
  EXPECT_VALUES(conv_transpose1d(x, w, b, {.stride = 2}).value(), {1, 6, 1}, {1, 10, 102, 1020, 200, 2000});
  EXPECT_VALUES(conv_transpose1d(x, w, b, {.stride = 2, .padding = 1}).value(), {1, 4, 1},
                {10, 102, 1020, 200});
}

TEST(Conv, RefusesOtherShapesBadOptionsAndEmptyOutputs) {
  const Variable x(Tensor::zeros({4, 40, 40, 3})), w(Tensor::zeros({3, 3, 8, 16})), b(Tensor::zeros({16}));
  const Variable w3(Tensor::zeros({3, 3, 3, 16})), flat(Tensor::zeros({2, 3}));
  EXPECT_REFUSAL("conv2d: x expects rank 4, got [2,3]", conv2d(flat, w, b, {}));
  EXPECT_REFUSAL("conv1d: x expects rank 3, got [4,40,40,3]", conv1d(x, w, b, {}));
  EXPECT_REFUSAL("conv2d: w expects rank 4, got [2,3]", conv2d(x, flat, b, {}));
  EXPECT_REFUSAL("conv2d: x expects 8 channels, as w [3,3,8,16], got [4,40,40,3]", conv2d(x, w, b, {}));
  EXPECT_REFUSAL("conv_transpose2d: x expects 8 channels, as w [3,3,8,16], got [4,40,40,3]",
                 conv_transpose2d(x, w, b, {}));
  EXPECT_REFUSAL("conv2d: w expects 1 to 4096 channels, got [3,3,0,2]",
                 conv2d(zeros({1, 3, 3, 0}), zeros({3, 3, 0, 2}), b, {}));
  EXPECT_REFUSAL("conv2d: w expects a kernel of 1 or more, got [3,0,3,16]",
                 conv2d(x, zeros({3, 0, 3, 16}), b, {.padding = 1}));
  EXPECT_REFUSAL("conv2d: b expects [16], got [2,3]", conv2d(x, w3, flat, {}));
  EXPECT_REFUSAL("conv2d: stride expects 1 to 4096, got 0", conv2d(x, w3, b, {.stride = 0}));
  EXPECT_REFUSAL("conv2d: stride expects 1 to 4096, got 4097", conv2d(x, w3, b, {.stride = 4097}));
  EXPECT_REFUSAL("conv2d: padding expects 0 to 4096, got -1", conv2d(x, w3, b, {.padding = -1}));
  EXPECT_REFUSAL("conv2d: padding expects 0 to 4096, got 4097", conv2d(x, w3, b, {.padding = 4097}));
  const Variable small(Tensor::zeros({1, 2, 2, 3}));
  EXPECT_REFUSAL(
      "conv2d: x expects pixels for an output of 1 or more with w [3,3,3,16], stride 1 and padding 0, got "
      "[1,2,2,3]",
      conv2d(small, w3, b, {}));
  EXPECT_REFUSAL(
      "conv_transpose2d: x expects pixels for an output of 1 or more with w [3,3,3,16], stride 1 and padding "
      "2, got [1,2,2,3]",
      conv_transpose2d(small, w3, b, {.padding = 2}));
}

}  // namespace supertac::convolution_test
