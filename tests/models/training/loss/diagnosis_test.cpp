#include "models/training/loss/collapse.h"

#include <gtest/gtest.h>

#include <limits>

#include "models/training/loss/loss.h"
#include "tests/models/support.h"

namespace supertac {
namespace {

constexpr real kNan = std::numeric_limits<real>::quiet_NaN();

struct Latents {
  SuperTac model = random_network();
  Tensor windows = uniform({2, 32, 16}, 1), truth = uniform({2, 8, 8, 1}, 3);

  std::string where() const {
    const SuperTac::Output output = model.forward(windows, normal_eps(2, 3, 2));
    return where_not_finite(supertac_loss(output, truth, {}).total, model.parameters());
  }
};

TEST(Diagnosis, SaysNothingOfAFiniteLoss) { EXPECT_EQ(Latents().where(), ""); }

TEST(Diagnosis, NamesAnInput) {
  Latents s;
  s.windows.data()[16 * 5 + 9] = kNan;  // taxel 9 belongs to group 2
  EXPECT_EQ(s.where(), "an input of conv1d in encoder.2.conv.0 is not finite");
}

TEST(Diagnosis, NamesTheTruth) {
  Latents s;
  s.truth.data()[70] = kNan;
  EXPECT_EQ(s.where(), "an input of l2_loss behind upsampler.out is not finite");
}

TEST(Diagnosis, NamesAParameterAndALayer) {
  Latents s;
  weights_of(s.model, "upsampler.fc.weight").fill(real(3e38));
  EXPECT_EQ(s.where(), "the output of linear in upsampler.fc is the first that is not finite");
  weights_of(s.model, "upsampler.out.bias").fill(kNan);
  EXPECT_EQ(s.where(), "parameter upsampler.out.bias is not finite");
}

TEST(Diagnosis, NamesTheGradientNearestToTheLoss) {
  Latents s;
  backward(supertac_loss(s.model.forward(s.windows, normal_eps(2, 3, 2)), s.truth, {}).total);
  EXPECT_EQ(gradient_not_finite(s.model.parameters()), "");
  for (const Parameter& p : s.model.parameters()) {
    if (p.name.starts_with("encoder.") || p.name == "upsampler.fc.weight")
      Variable(p.value).mutable_grad().fill(kNan);
  }
  EXPECT_EQ(gradient_not_finite(s.model.parameters()), "upsampler.fc.weight");
}

}  // namespace
}  // namespace supertac
