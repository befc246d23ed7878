#include "models/training/loss/loss.h"

#include "autograd/ops/losses.h"
#include "tests/models/support.h"
#include "tests/support/test.h"

namespace supertac::loss_test {

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
  const SuperTac::Output output = random_network().forward(uniform({2, 32, 16}, 1), normal_eps(2, 3, 2));
  EXPECT_REFUSAL("picture_loss: truth expects [2,8,8,1], got [2,16,16,1]",
                 supertac_loss(output, uniform({2, 16, 16, 1}, 3), {}));
  EXPECT_REFUSAL("picture_loss: truth expects [2,8,8,1], got [2,8,1]",
                 picture_loss(output.picture, uniform({2, 8, 1}, 3), 0.1));
  EXPECT_REFUSAL("loss: a expects 0 to 1, got 2", LossWeights{.a = 2}.check());
  EXPECT_REFUSAL("loss: beta expects 0 or more, got -1", LossWeights{.beta = -1}.check());
  EXPECT_REFUSAL("loss: lambda expects 0 or more, got -1", LossWeights{.lambda = -1}.check());
}

}  // namespace supertac::loss_test
