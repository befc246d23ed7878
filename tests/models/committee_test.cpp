#include "models/committee.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <string>

#include "tests/models/support.h"

namespace supertac {
namespace {

SuperTac small_model(std::uint64_t seed, Dim latent = 2) {
  Rng rng(seed);
  return SuperTac({.timesteps = 32, .latent = latent, .scale = 2, .channels = 8, .rcabs = 1}, rng);
}

TEST(Committee, AveragesItsMembers) {
  const TemporaryFolder folder;
  const std::vector<std::string> paths{folder / "a.safetensors", folder / "b.safetensors"};
  save_model(paths[0], small_model(1), {}, {});
  save_model(paths[1], small_model(2), {}, {});
  const std::vector<ModelFile> files = load_models(paths);
  const Tensor windows = Tensor::full({3, 32, 16}, real(0.4));
  const Tensor a = Prepared(*files[0].model).estimate(windows).picture,
               b = Prepared(*files[1].model).estimate(windows).picture;
  const Tensor mean = Committee(files).infer(windows), alone = Committee(*files[0].model).infer(windows);
  ASSERT_EQ(mean.shape(), a.shape());
  double difference = 0;
  for (std::size_t i = 0; i < a.values().size(); ++i) {
    EXPECT_FLOAT_EQ(mean.values()[i], (a.values()[i] + b.values()[i]) / 2);
    EXPECT_EQ(alone.values()[i], a.values()[i]);
    difference += std::abs(a.values()[i] - b.values()[i]);
  }
  EXPECT_GT(difference, 0) << "the two seeds draw the same, so nothing was averaged";
}

// Where members differ, the committee is less sure than any of them.
TEST(Committee, AddsTheVarianceOfItsMembersToTheirSpread) {
  const TemporaryFolder folder;
  const std::vector<std::string> paths{folder / "a.safetensors", folder / "b.safetensors"};
  for (std::uint64_t m = 0; m < 2; ++m) {
    Rng rng(m + 1);
    save_model(
        paths[m],
        SuperTac({.timesteps = 32, .latent = 2, .scale = 2, .channels = 8, .rcabs = 1, .spread = true}, rng),
        {}, {});
  }
  const std::vector<ModelFile> files = load_models(paths);
  const Tensor windows = Tensor::full({3, 32, 16}, real(0.4));
  const Estimate a = Prepared(*files[0].model).estimate(windows),
                 b = Prepared(*files[1].model).estimate(windows);
  const Estimate both = Committee(files).estimate(windows);
  for (std::size_t i = 0; i < a.picture.values().size(); ++i) {
    const double half = (a.picture.values()[i] - b.picture.values()[i]) / 2;
    const double squares = (std::pow(a.spread.values()[i], 2) + std::pow(b.spread.values()[i], 2)) / 2;
    EXPECT_NEAR(both.spread.values()[i], std::sqrt(squares + half * half), 1e-5);
    EXPECT_FLOAT_EQ(both.picture.values()[i], (a.picture.values()[i] + b.picture.values()[i]) / 2);
  }
}

TEST(Committee, TakesOneKindOfModelOnly) {
  EXPECT_THROW(Committee(std::span<const ModelFile>()), std::invalid_argument);
  const TemporaryFolder folder;
  const std::vector<std::string> latents{folder / "a.safetensors", folder / "b.safetensors"};
  save_model(latents[0], small_model(1), {}, {});
  save_model(latents[1], small_model(1, 3), {}, {});
  try {
    load_models(latents);
    FAIL() << "networks of two kinds were taken";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("differ in their seeds only"), std::string::npos)
        << error.what();
  }
  InputSettings slower;
  slower.rate_hz = 100;
  save_model(latents[1], small_model(2), slower, {});
  EXPECT_THROW(load_models(latents), std::runtime_error);
}

}  // namespace
}  // namespace supertac
