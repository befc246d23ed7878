// The whole SuperTac loss, every parameter, in double precision.
#include <gtest/gtest.h>

#include "autograd/gradient_checker.h"
#include "autograd/ops/arithmetic.h"
#include "autograd/ops/losses.h"
#include "models/training/loss/loss.h"

namespace supertac {
namespace {

Tensor uniform(const Shape& shape, std::uint64_t seed) {
  Tensor t(shape);
  const RandomStream random(seed, 1);
  std::uint64_t i = 0;
  for (real& x : t.values()) x = random.uniform(i++);
  return t;
}

void expect_right_gradients(const SuperTacSettings& settings) {
  Rng rng(5);
  const SuperTac model(settings, rng);
  // At the initial weights the deepest gradients are 1e-10 of the loss, below what a difference of doubles
  // resolves.
  for (Variable v : values_of(model.parameters())) {
    if (v.rank() < 2) continue;
    for (real& w : v.mutable_value().values()) w *= 2.2;
  }
  const Tensor windows = uniform({2, settings.timesteps, settings.signals()}, 1);
  const Tensor truth = uniform({2, settings.image_height(), settings.image_width(), 1}, 2);
  std::vector<Tensor> eps;
  for (Dim i = 0; i < settings.groups(); ++i)
    eps.push_back(uniform({2, settings.latent}, 3 + static_cast<std::uint64_t>(i)));
  const auto loss = [&] {
    return supertac_loss(model.forward(windows, eps), truth, {.a = 0.5, .beta = 0.01, .lambda = 0.3}).total;
  };
  const GradientReport report =
      check_gradients(loss, values_of(model.parameters()),
                      {.max_entries_per_input = 4, .names = names_of(model.parameters())});
  EXPECT_LE(report.max_relative_error, 1e-6) << report.text();
  EXPECT_GT(report.entries, 100);
}

TEST(SuperTacGradient, PictureOfEightPixels) {
  SuperTacSettings s;
  s.timesteps = 32;
  s.latent = 3;
  s.scale = 2;
  s.channels = 8;
  expect_right_gradients(s);
}

TEST(SuperTacGradient, WithAWayForTheLastFrame) {
  SuperTacSettings s;
  s.timesteps = 32;
  s.latent = 2;
  s.scale = 2;
  s.channels = 8;
  s.rcabs = 1;
  s.last_frame_path = true;
  expect_right_gradients(s);
}

TEST(SuperTacGradient, PictureOfSixteenPixelsVerticalGroups) {
  SuperTacSettings s;
  s.timesteps = 48;
  s.latent = 2;
  s.scale = 4;
  s.channels = 8;
  s.rcabs = 1;
  s.grouping = Grouping::vertical;
  expect_right_gradients(s);
}

// Rows, columns and channels all differ, so that none can stand for another.
TEST(SuperTacGradient, ThreeByFiveTaxelsOfTwoChannels) {
  SuperTacSettings s;
  s.rows = 3, s.columns = 5, s.in_channels = 2;
  s.timesteps = 32;
  s.latent = 2;
  s.channels = 4;
  s.rcabs = 1;
  for (const Grouping grouping : {Grouping::horizontal, Grouping::vertical}) {
    s.grouping = grouping;
    expect_right_gradients(s);
  }
}

TEST(SuperTacGradient, SingleFrames) {
  expect_right_gradients(
      {.rows = 2, .columns = 5, .in_channels = 2, .timesteps = 1, .channels = 8, .rcabs = 1});
}

}  // namespace
}  // namespace supertac
