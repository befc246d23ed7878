// Failures 8, 9 and 10: what the layers do to a picture before anything is learnt.

#include "autograd/ops/arithmetic.h"
#include "layers/residual.h"
#include "tests/models/support.h"
#include "tests/support/test.h"

namespace supertac::network_test {

// A constant map, doubled by random weights: the variance of the means of the four pixel phases, relative to
// the square of the mean.
double checkerboard(Dim kernel) {
  double phases = 0, level = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Rng rng(seed);
    const ConvTranspose2d up(16, 1, {.kernel = kernel, .stride = 2, .padding = 1}, rng);
    for (real& w : Variable(up.parameters()[0].value).mutable_value().values()) w = std::abs(w);
    Variable(up.parameters()[1].value).mutable_value().fill(0);
    const Tensor y = up.forward(Variable(Tensor::full({1, 8, 8, 16}, 1))).value();
    const Dim width = y.dim(2);
    const real* const at = y.data() + 6 * width + 6;
    const auto [mean, variance] = moments_of(Tensor::of({4}, {at[0], at[1], at[width], at[width + 1]}));
    phases += variance;
    level += mean * mean;
  }
  return phases / level;
}

TEST(Failures, F8KernelThreeDrawsACheckerboardKernelFourDoesNot) {
  EXPECT_GT(checkerboard(3), 0.2);
  EXPECT_LT(checkerboard(4), 0.02);
}

// Variance after `depth` blocks, relative to what came in. Off: weights as large as He et al. 2015 draw them
// for ReLU, and no attention.
double growth(int depth, bool safeguards) {
  Rng rng(5);
  const Tensor input = Tensor::of({4, 8, 8, 16}, normal_eps(4 * 64, 16, 1)[0].values());
  Variable h(input);
  for (int i = 0; i < depth; ++i) {
    const Rcab block(16, rng);
    for (const Parameter& p : block.parameters()) {
      if (safeguards) continue;
      if (p.name == "attention.expand.bias") Variable(p.value).mutable_value().fill(50);  // gates of 1
      if (!p.name.starts_with("conv.")) continue;
      for (real& w : Variable(p.value).mutable_value().values()) w *= std::sqrt(real(6));
    }
    h = block.forward(h);
  }
  return moments_of(h.value()).second / moments_of(input).second;
}

// The stacks of this network are at most nine blocks deep; with PyTorch's initialisation and gates near one
// half they need no residual scaling.
TEST(Failures, F9DeepStacksOfResidualBlocksBlowUpWithLargerWeights) {
  EXPECT_GT(growth(24, false), 1e4);
  EXPECT_LT(growth(9, true), 2);
  EXPECT_LT(growth(24, true), 4);
}

// Saturated gates stop learning, and a block with gates of 0 does nothing. The skip passes both the picture
// and the gradient on, so that the rest of the network goes on learning; no other safeguard is needed.
TEST(Failures, F10SaturatedGatesLeaveTheSkip) {
  for (const real bias : {real(-100), real(100)}) {
    Rng rng(2);
    const Rcab block(8, rng);
    Variable expand = parameter_of(block, "attention.expand.bias");
    expand.mutable_value().fill(bias);
    const Variable x(uniform({1, 4, 4, 8}, 3), true);
    const Variable y = block.forward(x);
    backward(sum(y * y));
    EXPECT_LT(std::abs(expand.grad().data()[0]), 1e-20);  // nothing moves the gate any more
    EXPECT_GT(std::abs(x.grad().data()[0]), 0);
    if (bias < 0) {
      EXPECT_TRUE(std::equal(x.value().data(), x.value().data() + x.size(), y.value().data()));
    }
  }
}

TEST(Failures, F10GatesBeginFarFromSaturation) {
  Rng rng(3);
  const ChannelAttention attention(32, rng);
  for (const real g : attention.gates(Variable(uniform({4, 4, 4, 32}, 1))).value().values()) {
    EXPECT_GT(g, 0.2);
    EXPECT_LT(g, 0.8);
  }
}

}  // namespace supertac::network_test
