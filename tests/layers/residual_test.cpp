#include "layers/residual.h"

#include <gtest/gtest.h>

#include "tests/expect_error.h"
#include "tests/layers/noise.h"

namespace supertac {
namespace {

TEST(ChannelAttention, GatesStayInsideZeroAndOneAndDependOnTheMeanOnly) {
  Rng rng(3);
  const ChannelAttention attention(8, 4, rng);
  Tensor x = noise({2, 3, 5, 8}, 1);
  const Variable gates = attention.gates(Variable(x));
  EXPECT_EQ(gates.shape(), (Shape{2, 8}));
  for (const real g : gates.value().values()) {
    EXPECT_GT(g, 0);
    EXPECT_LT(g, 1);
  }
  for (Dim c = 0; c < 8; ++c) std::swap(x.data()[c], x.data()[8 + c]);  // two pixels change places
  const Variable again = attention.gates(Variable(x));
  for (Dim i = 0; i < 16; ++i) EXPECT_NEAR(again.value().data()[i], gates.value().data()[i], 1e-6);
}

TEST(ChannelAttention, RefusesAReductionThatLeavesNoChannel) {
  Rng rng(3);
  EXPECT_EQ(what_of<std::invalid_argument>([&] { ChannelAttention(4, 8, rng); }),
            "ChannelAttention: reduction expects 1 to the 4 channels, got 8");
}

TEST(ChannelAttention, MaySqueezeToOneChannel) {
  Rng rng(3);
  EXPECT_EQ(ChannelAttention(4, 4, rng).gates(Variable(noise({1, 2, 2, 4}, 1))).shape(), (Shape{1, 4}));
}

// Zeros, but for one tap of a convolution that passes each channel on; biases are 0, so gates are one half.
void pass_on(const Module& module, const std::string& name, Dim tap) {
  for (const Parameter& p : module.parameters()) {
    Variable value = p.value;
    if (!p.name.starts_with(name)) continue;
    value.mutable_value().fill(0);
    if (!p.name.ends_with("weight") || value.rank() != 4) continue;
    const Dim channels = value.dim(3);
    for (Dim c = 0; c < channels; ++c) value.mutable_value().data()[(tap * channels + c) * channels + c] = 1;
  }
}

TEST(Rcab, AddsWhatIsPositiveBehindTheFirstConvolution) {
  Rng rng(3);
  const Rcab block(2, 2, rng);
  pass_on(block, "conv", 4);
  pass_on(block, "attention", 0);
  const Tensor y = block.forward(Variable(Tensor::of({1, 1, 2, 2}, {4, -4, -2, 2}))).value();
  const real expected[] = {6, -4, -2, 3};  // x + relu(x) / 2
  for (Dim i = 0; i < 4; ++i) EXPECT_EQ(y.data()[i], expected[i]) << i;
}

TEST(Rirb, AddsItsInputToWhatItsBlocksMake) {
  Rng rng(3);
  const Rirb rirb({.channels = 2, .reduction = 2, .blocks = 1}, rng);
  for (const char* part : {"rcab.0.conv", "conv"}) pass_on(rirb, part, 4);
  pass_on(rirb, "rcab.0.attention", 0);
  pass_on(rirb, "up", 5);  // of 4x4 taps the one that puts pixel i at 2 i
  const Tensor y = rirb.forward(Variable(Tensor::of({1, 1, 1, 2}, {4, -4}))).value();
  ASSERT_EQ(y.shape(), (Shape{1, 2, 2, 2}));
  EXPECT_EQ(y.data()[0], 4 + 6);
  EXPECT_FLOAT_EQ(static_cast<float>(y.data()[1]), -0.01F * (4 + 4));  // leaky
  for (Dim i = 2; i < 8; ++i) EXPECT_EQ(y.data()[i], 0) << i;
}

}  // namespace
}  // namespace supertac
