#include "autograd/ops/convolution.h"

#include <string>

#include "autograd/ops/arithmetic.h"
#include "tests/autograd/check.h"

namespace supertac {
namespace {

using namespace test;

struct Case {
  Dim images, height, width, in, out, kernel, stride, padding;
};

// H != W, stride 2, odd sizes, a single pixel, channel counts around the vector lengths 8, 16, 32; the cases
// with few outputs take the narrow path.
const Case kCases[] = {{2, 5, 7, 3, 17, 3, 1, 1}, {1, 6, 4, 1, 1, 3, 2, 1},   {2, 7, 5, 17, 3, 3, 2, 1},
                       {1, 4, 4, 33, 1, 3, 1, 1}, {2, 3, 4, 1, 33, 1, 1, 0},  {1, 5, 4, 17, 33, 2, 2, 0},
                       {2, 4, 3, 3, 5, 4, 2, 1},  {1, 9, 2, 16, 32, 3, 1, 2}, {2, 1, 1, 3, 8, 3, 1, 1},
                       {1, 8, 11, 5, 1, 4, 2, 1}, {1, 3, 3, 2, 2, 1, 3, 2}};

Shape x_shape(const Case& c) { return {c.images, c.height, c.width, c.in}; }
Shape w_shape(const Case& c) { return {c.kernel, c.kernel, c.in, c.out}; }
ConvOptions options(const Case& c) { return {.stride = c.stride, .padding = c.padding}; }
std::string text(const Case& c) {
  return "x " + x_shape(c).text() + " weight " + w_shape(c).text() + " stride " + std::to_string(c.stride);
}

// The header's formula, in double precision.
double conv_at(const Case& c, const Tensor& x, const Tensor& w, Dim n, Dim i, Dim j, Dim o) {
  double total = 0;
  for (Dim ky = 0; ky < c.kernel; ++ky) {
    for (Dim kx = 0; kx < c.kernel; ++kx) {
      const Dim py = i * c.stride + ky - c.padding, px = j * c.stride + kx - c.padding;
      if (py < 0 || py >= c.height || px < 0 || px >= c.width) continue;
      for (Dim k = 0; k < c.in; ++k) {
        total += static_cast<double>(x.data()[((n * c.height + py) * c.width + px) * c.in + k]) *
                 static_cast<double>(w.data()[((ky * c.kernel + kx) * c.in + k) * c.out + o]);
      }
    }
  }
  return total;
}

TEST(Conv2d, IsItsFormula) {
  for (const Case& c : kCases) {
    const Tensor x = numbers(x_shape(c)), w = numbers(w_shape(c), 2), b = numbers({c.out}, 3);
    const Variable y = conv2d(Variable(x), Variable(w), Variable(b), options(c));
    Dim at = 0;
    for (Dim n = 0; n < y.dim(0); ++n) {
      for (Dim i = 0; i < y.dim(1); ++i) {
        for (Dim j = 0; j < y.dim(2); ++j) {
          for (Dim o = 0; o < c.out; ++o, ++at) {
            const double expected = conv_at(c, x, w, n, i, j, o) + static_cast<double>(b.data()[o]);
            ASSERT_NEAR(static_cast<double>(y.value().data()[at]), expected, 20 * kRounding) << text(c);
          }
        }
      }
    }
  }
}

// <conv(x), y> = <x, convT(y)>: with the weight's channels exchanged one is the other's transpose.
TEST(ConvTranspose2d, IsTheTransposeOfConv2d) {
  for (const Case& c : kCases) {
    const Tensor x = numbers(x_shape(c)), w = numbers(w_shape(c), 2);
    const Variable y = conv2d(Variable(x), Variable(w), Variable(Tensor::zeros({c.out})), options(c));
    const Tensor r = numbers(y.shape(), 3);
    Tensor exchanged(Shape{c.kernel, c.kernel, c.out, c.in});
    for (Dim t = 0; t < c.kernel * c.kernel; ++t) {
      for (Dim i = 0; i < c.in; ++i) {
        for (Dim o = 0; o < c.out; ++o) {
          exchanged.data()[(t * c.out + o) * c.in + i] = w.data()[(t * c.in + i) * c.out + o];
        }
      }
    }
    if ((y.dim(1) - 1) * c.stride - 2 * c.padding + c.kernel != c.height ||
        (y.dim(2) - 1) * c.stride - 2 * c.padding + c.kernel != c.width) {
      continue;  // the strided conv did not use the last rows: the sizes of the transpose differ
    }
    const Variable back =
        conv_transpose2d(Variable(r), Variable(exchanged), Variable(Tensor::zeros({c.in})), options(c));
    EXPECT_NEAR(dot(y.value(), r), dot(x, back.value()), 100 * kRounding) << text(c);
  }
}

TEST(Conv1d, HandComputed) {
  const Variable x(Tensor::of({1, 4, 1}, {1, 2, 3, 4})), w(Tensor::of({3, 1, 1}, {1, 10, 100}));
  const Variable b(Tensor::of({1}, {1000}));
  expect_values(conv1d(x, w, b, {.padding = 1}).value(), {1, 4, 1}, {1210, 1321, 1432, 1043});
  expect_values(conv1d(x, w, b, {.stride = 2, .padding = 1}).value(), {1, 2, 1}, {1210, 1432});
}

TEST(ConvTranspose1d, HandComputed) {
  const Variable x(Tensor::of({1, 2, 1}, {1, 2})), w(Tensor::of({4, 1, 1}, {1, 10, 100, 1000}));
  const Variable b(Tensor::of({1}, {0}));
  expect_values(conv_transpose1d(x, w, b, {.stride = 2}).value(), {1, 6, 1}, {1, 10, 102, 1020, 200, 2000});
  expect_values(conv_transpose1d(x, w, b, {.stride = 2, .padding = 1}).value(), {1, 4, 1},
                {10, 102, 1020, 200});
}

TEST(Conv, AnEmptyBatchIsFine) {
  const Variable x = parameter(Tensor::zeros({0, 6, 2})), w = parameter(numbers({3, 2, 5})),
                 b = parameter(numbers({5}));
  const Variable y = conv1d(x, w, b, {.padding = 1}), wide = conv_transpose1d(x, w, b, {.stride = 2});
  EXPECT_EQ(y.shape().text(), "[0,6,5]");
  EXPECT_EQ(wide.shape().text(), "[0,13,5]");
  backward(sum(y));
  backward(sum(wide));
  EXPECT_EQ(x.grad().shape().text(), "[0,6,2]");
  EXPECT_TRUE(same_bytes(w.grad(), Tensor::zeros({3, 2, 5})));
  EXPECT_TRUE(same_bytes(b.grad(), Tensor::zeros({5})));
  const Variable maps = parameter(Tensor::zeros({0, 6, 4, 2})), square = parameter(numbers({3, 3, 2, 5}));
  for (const Variable& of :
       {conv2d(maps, square, b, {.padding = 1}), conv_transpose2d(maps, square, b, {.padding = 1})}) {
    EXPECT_EQ(of.shape().text(), "[0,6,4,5]");
    backward(sum(of));
  }
  EXPECT_EQ(maps.grad().shape().text(), "[0,6,4,2]");
  EXPECT_TRUE(same_bytes(square.grad(), Tensor::zeros({3, 3, 2, 5})));
}

TEST(Conv, RefusesWithNames) {
  const Variable x(Tensor::zeros({4, 40, 40, 3})), w(Tensor::zeros({3, 3, 8, 16})), b(Tensor::zeros({16}));
  const Variable w3(Tensor::zeros({3, 3, 3, 16})), flat(Tensor::zeros({2, 3}));
  expect_refusal("conv2d: x expects rank 4, got [2,3]", [&] { conv2d(flat, w, b, {}); });
  expect_refusal("conv1d: x expects rank 3, got [4,40,40,3]", [&] { conv1d(x, w, b, {}); });
  expect_refusal("conv2d: w expects rank 4, got [2,3]", [&] { conv2d(x, flat, b, {}); });
  expect_refusal("conv2d: w expects 8 input channels, x has 3 (x [4,40,40,3], w [3,3,8,16])",
                 [&] { conv2d(x, w, b, {}); });
  expect_refusal("conv_transpose2d: w expects 8 input channels, x has 3 (x [4,40,40,3], w [3,3,8,16])",
                 [&] { conv_transpose2d(x, w, b, {}); });
  expect_refusal("conv2d: channels must be 1 to 4096 (x [1,3,3,0], w [3,3,0,2])", [&] {
    conv2d(Variable(Tensor::zeros({1, 3, 3, 0})), Variable(Tensor::zeros({3, 3, 0, 2})), b, {});
  });
  expect_refusal("conv2d: the kernel must be at least 1 wide (x [4,40,40,3], w [3,0,3,16])", [&] {
    conv2d(x, Variable(Tensor::zeros({3, 0, 3, 16})), b, {.padding = 1});
  });
  expect_refusal("conv2d: b expects [16], got [2,3]", [&] { conv2d(x, w3, flat, {}); });
  expect_refusal("conv2d: stride must be positive and padding not negative, got 0 and 0",
                 [&] { conv2d(x, w3, b, {.stride = 0}); });
  expect_refusal("conv2d: stride must be positive and padding not negative, got 1 and -1",
                 [&] { conv2d(x, w3, b, {.padding = -1}); });
}

TEST(Conv, RefusesEmptyOutputs) {
  const Variable x(Tensor::zeros({1, 2, 2, 3})), w(Tensor::zeros({3, 3, 3, 4})), b(Tensor::zeros({4}));
  expect_refusal("conv2d: the output would be empty (x [1,2,2,3], w [3,3,3,4], stride 1, padding 0)",
                 [&] { conv2d(x, w, b, {}); });
  expect_refusal(
      "conv_transpose2d: the output would be empty (x [1,2,2,3], w [3,3,3,4], stride 1, padding 2)",
      [&] { conv_transpose2d(x, w, b, {.padding = 2}); });
}

}  // namespace
}  // namespace supertac
