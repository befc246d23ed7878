#include "models/training/loss/loss.h"

#include "autograd/ops/losses.h"
#include "models/training/loss/collapse.h"
#include "tests/models/support.h"
#include "tests/support/test.h"

namespace supertac::loss_test {

struct Sample {
  SuperTac model = random_network();
  Tensor windows = uniform({2, 32, 16}, 1), truth = uniform({2, 8, 8, 1}, 3);
  SuperTac::Output output = model.forward(windows, normal_eps(2, 3, 2));

  std::string where() const {
    const SuperTac::Output anew = model.forward(windows, normal_eps(2, 3, 2));
    return where_not_finite(supertac_loss(anew, truth, {}).total, model.parameters());
  }
};

// One of two pictures has a truth to compare structure with; of the other only the squared error counts.
TEST(PictureLoss, TheSsimOfAFlatTruthCountsAsOne) {
  const Variable picture(uniform({2, 16, 16, 1}, 1), true);
  Tensor truth = uniform({2, 16, 16, 1}, 2), one(Shape{1, 16, 16, 1}), its(Shape{1, 16, 16, 1});
  std::copy_n(picture.value().data(), 256, one.data());
  std::copy_n(truth.data(), 256, its.data());
  std::fill_n(truth.data() + 256, 256, 0.25F);
  const Loss loss = picture_loss(picture, truth, 0.5);
  EXPECT_NEAR(loss.ssim.item(), (ssim(Variable(one), its).item() + 1) / 2, 1e-6);
  backward(loss.ssim);
  const auto sum = [&](Dim from) {
    double total = 0;
    for (Dim i = from; i < from + 256; ++i) total += std::abs(picture.grad().data()[i]);
    return total;
  };
  EXPECT_GT(sum(0), 0);
  EXPECT_EQ(sum(256), 0);
}

// The predicted error is drawn towards the picture's error, and the picture does not notice.
TEST(SuperTacLoss, IsTheConvexCombinationOfItsTermsAndThePredictedErrorLearnsTheError) {
  SuperTacSettings settings = small_settings();
  settings.predicted_error = true;
  const SuperTac model = random_network(settings);
  const SuperTac::Output output = model.forward(uniform({2, 32, 16}, 1), normal_eps(2, 3, 2));
  const Tensor truth = uniform({2, 8, 8, 1}, 3);
  const Loss loss = supertac_loss(output, truth, {.a = 0.3, .beta = 0.02, .lambda = 0.5});
  double expected = 0;
  for (std::size_t i = 0; i < truth.values().size(); ++i) {
    const double error = std::abs(output.picture.value().values()[i] - truth.values()[i]);
    expected += std::pow(output.predicted_error.value().values()[i] - error, 2) / 128;
  }
  EXPECT_NEAR(loss.predicted_error.item(), expected, 1e-6);
  EXPECT_NEAR(loss.total.item(),
              0.3 * (loss.reconstruction.item() + 0.02 * loss.kld.item()) +
                  0.7 * (loss.l2.item() + 0.5 * (1 - loss.ssim.item()) +
                         kPredictedErrorWeight * loss.predicted_error.item()),
              1e-6);
  backward(loss.predicted_error);
  for (const Parameter& p : model.parameters()) {
    const bool of_picture = p.name.starts_with("upsampler.out");
    const bool moved = p.value.grad().defined() &&
                       std::ranges::any_of(p.value.grad().values(), [](real g) { return g != 0; });
    EXPECT_TRUE(!of_picture || !moved) << p.name;
    EXPECT_TRUE(moved || !p.name.starts_with("upsampler.spread")) << p.name;
  }
}

TEST(SuperTacLoss, RefusesTruthOfAnotherSizeAndNegativeWeights) {
  const Sample s;
  EXPECT_REFUSAL("picture_loss: truth expects [2,8,8,1], got [2,16,16,1]",
                 supertac_loss(s.output, uniform({2, 16, 16, 1}, 3), {}));
  EXPECT_REFUSAL("picture_loss: truth expects [2,8,8,1], got [2,8,1]",
                 picture_loss(s.output.picture, uniform({2, 8, 1}, 3), 0.1));
  EXPECT_REFUSAL("loss: a expects 0 to 1, got 2", LossWeights{.a = 2}.check());
  EXPECT_REFUSAL("loss: beta expects 0 or more, got -1", LossWeights{.beta = -1}.check());
}

constexpr real kNan = std::numeric_limits<real>::quiet_NaN();

TEST(Diagnosis, SaysNothingOfAFiniteLoss) { EXPECT_EQ(Sample().where(), ""); }

TEST(Diagnosis, NamesAnInput) {
  Sample s;
  s.windows.data()[16 * 5 + 9] = kNan;  // taxel 9 belongs to group 2
  EXPECT_EQ(s.where(), "an input of conv1d in encoder.2.conv.0 is not finite");
}

TEST(Diagnosis, NamesTheTruth) {
  Sample s;
  s.truth.data()[70] = kNan;
  EXPECT_EQ(s.where(), "an input of l2_loss behind upsampler.out is not finite");
}

TEST(Diagnosis, NamesAParameterAndALayer) {
  Sample s;
  weights_of(s.model, "upsampler.fc.weight").fill(real(3e38));
  EXPECT_EQ(s.where(), "the output of linear in upsampler.fc is the first that is not finite");
  weights_of(s.model, "upsampler.out.bias").fill(kNan);
  EXPECT_EQ(s.where(), "parameter upsampler.out.bias is not finite");
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

TEST(Senseless, IsBelowAFiftiethOrAboveTenTimesTheTruthsDeviation) {
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

TEST(Schedule, RisesThenFallsAlongACosine) {
  const Schedule s{.peak = 2, .warm_up = 4, .total = 104};
  EXPECT_DOUBLE_EQ(s.at(0), 0.5);
  EXPECT_DOUBLE_EQ(s.at(3), 2);
  EXPECT_DOUBLE_EQ(s.at(4), 2);
  EXPECT_NEAR(s.at(54), 1, 1e-12);
  EXPECT_NEAR(s.at(104), 0, 1e-12);
  EXPECT_NEAR(s.at(1000), 0, 1e-12);
  for (int i = 5; i < 104; ++i) EXPECT_LT(s.at(i), s.at(i - 1));
  const Schedule all_warm_up{.peak = 2, .warm_up = 10, .total = 5};
  EXPECT_DOUBLE_EQ(all_warm_up.at(4), 1);
  EXPECT_DOUBLE_EQ(all_warm_up.at(20), 2);
}

}  // namespace supertac::loss_test
