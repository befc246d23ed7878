#include "models/training/loss/loss.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "autograd/ops/losses.h"
#include "tests/expect_error.h"
#include "tests/models/support.h"

namespace supertac {
namespace {

struct Sample {
  SuperTac model = random_network();
  SuperTac::Output output = model.forward(uniform({2, 32, 16}, 1), normal_eps(2, 3, 2));
  Tensor truth = uniform({2, 8, 8, 1}, 3);
};

TEST(SuperTacLoss, IsTheConvexCombinationOfItsTerms) {
  const Sample s;
  const Loss loss = supertac_loss(s.output, s.truth, {.a = 0.3, .beta = 0.02, .lambda = 0.5});
  const double expected = 0.3 * (loss.reconstruction.item() + 0.02 * loss.kld.item()) +
                          0.7 * (loss.l2.item() + 0.5 * (1 - loss.ssim.item()));
  EXPECT_NEAR(loss.total.item(), expected, 1e-6);
}

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
TEST(SuperTacLoss, ThePredictedErrorLearnsTheError) {
  SuperTacSettings settings = small_settings();
  settings.predicted_error = true;
  const SuperTac model = random_network(settings);
  const SuperTac::Output output = model.forward(uniform({2, 32, 16}, 1), normal_eps(2, 3, 2));
  const Tensor truth = uniform({2, 8, 8, 1}, 3);
  const Loss loss = supertac_loss(output, truth, {});
  double expected = 0;
  for (std::size_t i = 0; i < truth.values().size(); ++i) {
    const double error = std::abs(output.picture.value().values()[i] - truth.values()[i]);
    expected += std::pow(output.predicted_error.value().values()[i] - error, 2) / 128;
  }
  EXPECT_NEAR(loss.predicted_error.item(), expected, 1e-6);
  EXPECT_NEAR(loss.total.item(),
              0.2 * (loss.reconstruction.item() + 1e-3 * loss.kld.item()) +
                  0.8 * (loss.l2.item() + 0.1 * (1 - loss.ssim.item()) +
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
  EXPECT_EQ(what_of<std::invalid_argument>([&] {
              supertac_loss(s.output, uniform({2, 16, 16, 1}, 3), {});
            }),
            "picture_loss: truth expects [2,8,8,1], got [2,16,16,1]");
  EXPECT_EQ(what_of<std::invalid_argument>([&] {
              picture_loss(s.output.picture, uniform({2, 8, 1}, 3), 0.1);
            }),
            "picture_loss: truth expects [2,8,8,1], got [2,8,1]");
  EXPECT_EQ(what_of<std::invalid_argument>([&] { LossWeights{.a = 2}.check(); }),
            "loss weights: expected 0 <= a <= 1, beta >= 0, lambda >= 0, got a = 2.000000, beta = 0.001000, "
            "lambda = 0.100000");
  EXPECT_EQ(what_of<std::invalid_argument>([&] { LossWeights{.beta = -1}.check(); }),
            "loss weights: expected 0 <= a <= 1, beta >= 0, lambda >= 0, got a = 0.200000, beta = -1.000000, "
            "lambda = 0.100000");
}

}  // namespace
}  // namespace supertac
