#include "layers/module.h"

#include <gtest/gtest.h>

#include <cmath>

#include "layers/convolution.h"
#include "layers/linear.h"
#include "layers/residual.h"
#include "tests/expect_error.h"

namespace supertac {
namespace {

TEST(Module, NamesItsPartsInOrder) {
  Rng rng(1);
  const Rirb rirb({.channels = 8, .reduction = 4, .blocks = 2}, rng);
  std::vector<std::string> names;
  for (const Parameter& p : rirb.parameters()) names.push_back(p.name);
  ASSERT_EQ(names.size(), 20u);
  EXPECT_EQ(names[0], "rcab.0.conv.0.weight");
  EXPECT_EQ(names[4], "rcab.0.attention.squeeze.weight");
  EXPECT_EQ(names[7], "rcab.0.attention.expand.bias");
  EXPECT_EQ(names[16], "conv.weight");
  EXPECT_EQ(names[19], "up.bias");
}

TEST(Module, ParametersAreHandles) {
  Rng rng(1);
  const Linear layer(2, 1, rng);
  Variable weight = layer.parameters()[0].value;
  weight.mutable_value().fill(3);
  Variable bias = layer.parameters()[1].value;
  bias.mutable_value().fill(1);
  EXPECT_EQ(layer.forward(Variable(Tensor::of({1, 2}, {1, 2}))).item(), 10);
}

TEST(Module, SameSeedSameLayerOtherSeedAnother) {
  Rng a(5), b(5), c(6);
  const Conv2d first(3, 4, {}, a), second(3, 4, {}, b), third(3, 4, {}, c);
  const auto values = [](const Module& m) {
    const auto v = m.parameters()[0].value.value().values();
    return std::vector<real>(v.begin(), v.end());
  };
  EXPECT_EQ(values(first), values(second));
  EXPECT_NE(values(first), values(third));
}

// U(-1/sqrt(fan_in), 1/sqrt(fan_in)) has the standard deviation 1/sqrt(3 fan_in).
TEST(Module, InitialisationHasTheVarianceItStates) {
  Rng rng(9);
  const Tensor t = uniform_fan_in({100, 100}, 25, rng);
  double squares = 0;
  real largest = 0;
  for (const real x : t.values()) {
    squares += static_cast<double>(x) * static_cast<double>(x);
    largest = std::max(largest, std::abs(x));
  }
  EXPECT_NEAR(std::sqrt(squares / 10000), 1 / std::sqrt(75.0), 2e-3);
  EXPECT_LE(largest, real(0.2));
  EXPECT_GT(largest, real(0.199));
}

TEST(Module, RefusesALayerWithoutInputs) {
  Rng rng(1);
  EXPECT_EQ(what_of<std::invalid_argument>([&] { Conv2d(3, 8, {.kernel = 0}, rng); }),
            "uniform_fan_in: shape expects an input and a kernel of 1 or more, got [0,0,3,8]");
}

}  // namespace
}  // namespace supertac
