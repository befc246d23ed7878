#include "layers/module.h"

#include "layers/convolution.h"
#include "layers/residual.h"
#include "tests/support/test.h"

namespace supertac::module_test {

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

TEST(Module, RefusesALayerWithoutInputsOrChannels) {
  Rng rng(1);
  EXPECT_REFUSAL("uniform_fan_in: shape expects an input and a kernel of 1 or more, got [0,0,3,8]",
                 Conv2d(3, 8, {.kernel = 0}, rng));
  EXPECT_REFUSAL("ChannelAttention: channels expects 4 or more, got 3", ChannelAttention(3, rng));
  EXPECT_NO_THROW(ChannelAttention(4, rng));
}

}  // namespace supertac::module_test
