#include "models/inference/ensemble.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "tests/expect_error.h"
#include "tests/models/support.h"

namespace supertac {
namespace {

SuperTac small_model(std::uint64_t seed, Dim latent = 2) {
  Rng rng(seed);
  return SuperTac({.timesteps = 32, .latent = latent, .scale = 2, .channels = 8, .rcabs = 1}, rng);
}

TEST(Ensemble, AveragesItsMembers) {
  const TemporaryFolder folder;
  const std::vector<std::string> paths{folder / "a.safetensors", folder / "b.safetensors"};
  save_model(paths[0], small_model(1), {}, {});
  save_model(paths[1], small_model(2), {}, {});
  const std::vector<ModelFile> files = load_models(paths);
  const Tensor windows = Tensor::full({3, 32, 16}, real(0.4));
  const Tensor a = Prepared(*files[0].model).estimate(windows).picture,
               b = Prepared(*files[1].model).estimate(windows).picture;
  const Tensor mean = ensemble_of(files).infer(windows),
               alone = Ensemble({Prepared(*files[0].model)}).infer(windows);
  ASSERT_EQ(mean.shape(), a.shape());
  double difference = 0;
  for (std::size_t i = 0; i < a.values().size(); ++i) {
    EXPECT_FLOAT_EQ(mean.values()[i], (a.values()[i] + b.values()[i]) / 2);
    EXPECT_EQ(alone.values()[i], a.values()[i]);
    difference += std::abs(a.values()[i] - b.values()[i]);
  }
  EXPECT_GT(difference, 0) << "the two seeds draw the same, so nothing was averaged";
}

// Where members differ, the ensemble is less sure than any of them.
TEST(Ensemble, AddsTheVarianceOfItsMembersToTheirSpread) {
  const TemporaryFolder folder;
  const std::vector<std::string> paths{folder / "a.safetensors", folder / "b.safetensors"};
  for (std::uint64_t m = 0; m < 2; ++m) {
    Rng rng(m + 1);
    save_model(
        paths[m],
        SuperTac(
            {.timesteps = 32, .latent = 2, .scale = 2, .channels = 8, .rcabs = 1, .predicted_error = true},
            rng),
        {}, {});
  }
  const std::vector<ModelFile> files = load_models(paths);
  const Tensor windows = Tensor::full({3, 32, 16}, real(0.4));
  const Estimate a = Prepared(*files[0].model).estimate(windows),
                 b = Prepared(*files[1].model).estimate(windows);
  const Estimate both = ensemble_of(files).estimate(windows);
  for (std::size_t i = 0; i < a.picture.values().size(); ++i) {
    const double half = (a.picture.values()[i] - b.picture.values()[i]) / 2;
    const double squares =
        (std::pow(a.predicted_error.values()[i], 2) + std::pow(b.predicted_error.values()[i], 2)) / 2;
    EXPECT_NEAR(both.predicted_error.values()[i], std::sqrt(squares + half * half), 1e-5);
    EXPECT_FLOAT_EQ(both.picture.values()[i], (a.picture.values()[i] + b.picture.values()[i]) / 2);
  }
}

void expect_refused(const std::vector<std::string>& paths, const std::string& why) {
  EXPECT_ERROR(load_models(paths), std::runtime_error, why);
}

TEST(Ensemble, SaysWhichModelsDoNotBelongTogether) {
  EXPECT_EQ(what_of<std::invalid_argument>([&] { Ensemble({}); }),
            "Ensemble: expected at least one network, got none");
  const TemporaryFolder folder;
  const std::string one = folder / "a.safetensors", larger = folder / "b.safetensors",
                    slow = folder / "slow.safetensors", random = folder / "random.safetensors",
                    unsure = folder / "unsure.safetensors", fine = folder / "fine.safetensors";
  InputSettings slower;
  slower.rate_hz = 100;
  save_model(one, small_model(1), {}, {});
  save_model(larger, small_model(1, 3), {}, {});
  save_model(slow, small_model(1), slower, {});
  SuperTacSettings settings = small_model(1).settings();
  Rng rng(1);
  settings.predicted_error = true;
  save_model(unsure, SuperTac(settings, rng), {}, {});
  settings = small_model(1).settings(), settings.scale = 4;
  save_model(fine, SuperTac(settings, rng), {}, {});
  save_model(random, small_model(2), {}, {{"random_plates", "100"}});
  EXPECT_EQ(load_models(std::vector{one, larger}).size(), 2U) << "their size does not matter";
  expect_refused({one, unsure}, "unsure.safetensors: its settings are");
  expect_refused({one, fine}, "fine.safetensors: its settings are");
  expect_refused({one, slow}, "slow.safetensors: its input are");
  EXPECT_EQ(load_models(std::vector{one, random}).size(), 2U) << "what they were trained on does not matter";
}

TEST(Ensemble, RefusesNetworksOfOtherInputs) {
  const SuperTac one = small_model(1);
  Rng rng(1);
  const SuperTac longer({.timesteps = 64, .latent = 2, .scale = 2, .channels = 8, .rcabs = 1}, rng);
  EXPECT_EQ(
      what_of<std::invalid_argument>([&] {
        Ensemble({Prepared(one), Prepared(longer)});
      }),
      "Ensemble: expected networks of one format, got one of 32 frame(s) of 4x4 taxels with 1 channel(s) and "
      "pictures of 8x8 and one of 64 frame(s) of 4x4 taxels with 1 channel(s) and pictures of 8x8");
}

}  // namespace
}  // namespace supertac
