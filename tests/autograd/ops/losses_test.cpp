#include "autograd/ops/losses.h"

#include "autograd/ops/arithmetic.h"
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

// SSIM's traps: flat images, opposite images, values far from zero, small images.

constexpr double kC1 = 1e-4, kC2 = 9e-4;

Tensor flat(Dim size, double value) { return Tensor::full({1, size, size, 1}, static_cast<real>(value)); }
Tensor textured(Dim size, double level = 0.5, double amplitude = 0.3) {
  Tensor t({1, size, size, 1});
  for (Dim i = 0; i < t.size(); ++i) {
    t.data()[i] = static_cast<real>(level + amplitude * std::sin(0.9 * static_cast<double>(i % size) +
                                                                 0.4 * static_cast<double>(i / size)));
  }
  return t;
}
double similarity(const Tensor& x, const Tensor& y) {
  return static_cast<double>(ssim(Variable(x), y).item());
}

// The definition, window by window, in double precision with centred moments.
double by_definition(const Tensor& x, const Tensor& y) {
  const Dim h = x.dim(1), w = x.dim(2), size = std::min(h, w) < 11 ? 7 : 11;
  double total = 0;
  for (Dim i = 0; i + size <= h; ++i) {
    for (Dim j = 0; j + size <= w; ++j) {
      double mass = 0, mx = 0, my = 0, vx = 0, vy = 0, cov = 0;
      for (int pass = 0; pass < 2; ++pass) {
        for (Dim k = 0; k < size * size; ++k) {
          const double dy = static_cast<double>(k / size) - 5, dx = static_cast<double>(k % size) - 5;
          const double weight = size == 7 ? 1 : std::exp(-(dx * dx + dy * dy) / 4.5);
          const double a = static_cast<double>(x.data()[(i + k / size) * w + j + k % size]);
          const double b = static_cast<double>(y.data()[(i + k / size) * w + j + k % size]);
          if (pass == 0) {
            mass += weight, mx += weight * a, my += weight * b;
          } else {
            vx += weight * (a - mx) * (a - mx), vy += weight * (b - my) * (b - my);
            cov += weight * (a - mx) * (b - my);
          }
        }
        if (pass == 0) mx /= mass, my /= mass;
      }
      vx /= mass, vy /= mass, cov /= mass;
      total += (2 * mx * my + kC1) * (2 * cov + kC2) / ((mx * mx + my * my + kC1) * (vx + vy + kC2));
    }
  }
  return total / static_cast<double>((h - size + 1) * (w - size + 1));
}

TEST(Ssim, IsItsDefinition) {
  for (const Shape& shape : {Shape{1, 16, 16, 1}, Shape{1, 8, 8, 1}, Shape{1, 32, 32, 1}, Shape{1, 13, 20, 1},
                             Shape{1, 7, 15, 1}, Shape{1, 11, 11, 1}}) {
    const Tensor x = numbers(shape, 1, 0, 1), y = numbers(shape, 2, 0, 1);
    EXPECT_NEAR(similarity(x, y), by_definition(x, y), kRounding) << shape.text();
    EXPECT_NEAR(similarity(x, x), 1, kRounding) << shape.text();
  }
  EXPECT_NEAR(similarity(flat(16, 0), flat(16, 1)), kC1 / (1 + kC1), kRounding);
  EXPECT_NEAR(similarity(flat(16, 0.5), textured(16)), by_definition(flat(16, 0.5), textured(16)), kRounding);
  const Tensor x = textured(16), opposite = textured(16, 0.5, -0.3);
  EXPECT_LT(similarity(x, opposite), -0.8);
  EXPECT_NEAR(similarity(x, opposite), by_definition(x, opposite), 5 * kRounding);
}

// E[x^2] - E[x]^2 at level 200 has lost all digits in fp32.
TEST(Ssim, VariancesSurviveAHighLevel) {
  const Tensor x = textured(16, 200, 0.3), y = textured(16, 200, 0.2);
  EXPECT_NEAR(similarity(x, y), by_definition(x, y), sizeof(real) == 4 ? 1e-4 : 1e-11);
}

TEST(Ssim, GradientIsFiniteEverywhere) {
  for (const Dim size : {7, 8, 16}) {
    for (const Tensor& x :
         {flat(size, 0), flat(size, 1), flat(size, 200), textured(size), textured(size, 200)}) {
      for (const Tensor& y : {flat(size, 0), flat(size, 1), textured(size), textured(size, 0.5, -0.3)}) {
        const Variable v = parameter(x.clone());
        backward(ssim(v, y));
        for (const real g : v.grad().values()) ASSERT_TRUE(std::isfinite(g));
      }
    }
  }
}

// The all-zero picture against a texture is where training can get stuck: the gradient must not be zero
// there.
TEST(Ssim, AFlatPictureIsPulledTowardsTheTexture) {
  const Variable v = parameter(flat(16, 0)), target(textured(16));
  backward(ssim(v, target.value()));
  EXPECT_GT(sum(Variable(v.grad()) * target).item(), 1e-2);
}

TEST(Ssim, RefusesOtherShapes) {
  const Variable x(Tensor::zeros({1, 16, 16, 1}));
  EXPECT_REFUSAL("ssim: x expects rank 4, got [16,16]", ssim(zeros({16, 16}), Tensor::zeros({16, 16})));
  EXPECT_REFUSAL("ssim: target expects [1,16,16,1], got [16,16]", ssim(x, Tensor::zeros({16, 16})));
  EXPECT_REFUSAL("ssim: target expects [1,16,16,1], got none", ssim(x, Tensor()));
  for (const Shape& bad : {Shape{1, 2, 16, 1}, Shape{1, 16, 16, 2}, Shape{0, 16, 16, 1}}) {
    EXPECT_REFUSAL("ssim: x expects [N,H,W,1] with N >= 1 and H, W >= 3, got " + bad.text(),
                   ssim(Variable(Tensor::zeros(bad)), Tensor::zeros(bad)));
  }
}

}  // namespace supertac::losses_test
