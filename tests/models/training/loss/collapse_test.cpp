#include "models/training/loss/collapse.h"

#include "models/training/loss/loss.h"
#include "tests/models/support.h"
#include "tests/support/test.h"

namespace supertac::collapse_test {

struct Sample {
  SuperTac model = random_network();
  Tensor windows = uniform({2, 32, 16}, 1), truth = uniform({2, 8, 8, 1}, 3);
  SuperTac::Output output = model.forward(windows, normal_eps(2, 3, 2));

  std::string where() const {
    const SuperTac::Output anew = model.forward(windows, normal_eps(2, 3, 2));
    return where_not_finite(supertac_loss(anew, truth, {}).total, model.parameters());
  }
};

constexpr real kNan = std::numeric_limits<real>::quiet_NaN();

TEST(Diagnosis, NamesAnInputTheTruthALayerOrAParameter) {
  const auto filled = [](const std::string& name, real value) {
    return [=](Sample& s) { parameter_of(s.model, name).mutable_value().fill(value); };
  };
  const std::pair<std::function<void(Sample&)>, const char*> cases[] = {
      {[](Sample&) {}, ""},
      {[](Sample& s) { s.windows.data()[16 * 5 + 9] = kNan; },  // taxel 9 belongs to group 2
       "an input of conv1d in encoder.2.conv.0 is not finite"},
      {[](Sample& s) { s.truth.data()[70] = kNan; },
       "an input of l2_loss behind upsampler.out is not finite"},
      {filled("upsampler.fc.weight", real(3e38)),
       "the output of linear in upsampler.fc is the first that is not finite"},
      {filled("upsampler.out.bias", kNan), "parameter upsampler.out.bias is not finite"}};
  for (const auto& [spoil, where] : cases) {
    Sample s;
    spoil(s);
    EXPECT_EQ(s.where(), where);
  }
}

TEST(Diagnosis, NamesTheGradientNearestToTheLoss) {
  Sample s;
  backward(supertac_loss(s.output, s.truth, {}).total);
  EXPECT_EQ(gradient_not_finite(s.model.parameters()), "");
  for (const Parameter& p : s.model.parameters()) {
    if (p.name.starts_with("encoder.") || p.name == "upsampler.fc.weight")
      Variable(p.value).mutable_grad().fill(kNan);
  }
  EXPECT_EQ(gradient_not_finite(s.model.parameters()), "upsampler.fc.weight");
}

// Two samples of one entry each, `far` to both sides of a half: a standard deviation of `far`.
struct Apart {
  explicit Apart(double far) {
    BatchVariance{sums}.add(Tensor::of({2, 1}, std::array{real(0.5 - far), real(0.5 + far)}));
  }
  operator BatchVariance() { return {sums}; }
  std::array<double, 2> sums{};
};

TEST(Degenerate, IsBelowAFiftiethOrAboveTenTimesTheTruthsDeviation) {
  Apart truths(0.25);
  EXPECT_TRUE(is_degenerate(Apart(0), truths, 2));
  EXPECT_TRUE(is_degenerate(Apart(0.25 * 0.019), truths, 2));
  EXPECT_FALSE(is_degenerate(Apart(0.25 * 0.021), truths, 2));
  EXPECT_FALSE(is_degenerate(Apart(0.25 * 9.9), truths, 2));
  EXPECT_TRUE(is_degenerate(Apart(0.25 * 10.1), truths, 2));
  EXPECT_FALSE(is_degenerate(Apart(0.25), Apart(0), 2));  // flat truths say nothing of size
}

TEST(ActiveLatents, HaveAVarianceAboveAHundredth) {
  EXPECT_EQ(active_latents(Apart(0.101), 2), 1);
  EXPECT_EQ(active_latents(Apart(0.099), 2), 0);
}

}  // namespace supertac::collapse_test
