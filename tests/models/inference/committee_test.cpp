#include "models/inference/committee.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
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

// Factor of initial weights, whose pictures would be the same of all windows.
constexpr real kStrong = real(1.5);

// A network that draws `height` everywhere, or without one what its weights draw, and says that its pixels
// may be off by `spread`.
std::string saved(const std::string& path, std::uint64_t seed, std::optional<real> height, real spread,
                  const std::map<std::string, std::string>& metadata, Dim latent = 2) {
  Rng rng(seed);
  const SuperTac model(
      {.timesteps = 32, .latent = latent, .scale = 2, .channels = 8, .rcabs = 1, .spread = true}, rng);
  for (Parameter parameter : model.parameters()) {
    const auto values = parameter.value.mutable_value().values();
    const bool out = parameter.name.starts_with("upsampler.out.");
    if (parameter.name == "upsampler.spread.bias")
      std::ranges::fill(values, spread);
    else if (parameter.name == "upsampler.spread.weight" || (out && height))
      std::ranges::fill(values, 0);
    else
      for (real& value : values) value *= kStrong;
    if (parameter.name == "upsampler.out.bias" && height) std::ranges::fill(values, *height);
  }
  save_model(path, model, {}, metadata);
  return path;
}

const std::map<std::string, std::string> kFeels{{"random_plates", "100"}};

// A flat picture is doubted by s^2 / (s^2 + .005): .15 of it is reached when the two lie .125 apart.
TEST(Committee, RecallsWhatAgreesWithWhatIsFeltAndElseFeels) {
  const TemporaryFolder folder;
  const std::string recalls = saved(folder / "recalls.safetensors", 1, real(0.3), real(0.01), {});
  const Tensor windows = Tensor::full({2, 32, 16}, real(0.4));
  for (const auto& [height, unfamiliar] : {std::pair(0.41, 0), {0.43, 1}, {0.19, 0}, {0.17, 1}, {0.3, 0}}) {
    // Of another size, and named first: neither matters.
    const std::string feels =
        saved(folder / "feels.safetensors", 2, static_cast<real>(height), real(0.25), kFeels, 3);
    for (const auto& paths : {std::vector{recalls, feels}, {feels, recalls}}) {
      const std::vector<ModelFile> files = load_models(paths);
      const Estimate drawn = Committee(files).estimate(windows);
      EXPECT_TRUE(std::ranges::equal(drawn.unfamiliar.values(), std::vector<real>(2, real(unfamiliar))))
          << height;
      for (const real value : drawn.picture.values())
        EXPECT_FLOAT_EQ(value, static_cast<real>(unfamiliar == 1 ? height : 0.3)) << height;
      for (const real value : drawn.spread.values())
        EXPECT_FLOAT_EQ(value, unfamiliar == 1 ? real(0.25) : real(0.01)) << height;
    }
  }
}

// Who is unsure of what it recalls is not believed, though what is felt be the same.
TEST(Committee, DoesNotRecallWhatItDoubts) {
  const TemporaryFolder folder;
  const std::vector<ModelFile> files =
      load_models(std::vector{saved(folder / "a.safetensors", 1, real(0.3), real(0.03), {}),
                              saved(folder / "b.safetensors", 1, real(0.3), real(0.25), kFeels)});
  EXPECT_EQ(Committee(files).estimate(Tensor::full({1, 32, 16}, real(0.4))).unfamiliar.item(), 1);
}

TEST(Committee, JudgesEachWindowAloneWhateverItsBatch) {
  const TemporaryFolder folder;
  const std::vector<ModelFile> files =
      load_models(std::vector{saved(folder / "a.safetensors", 1, {}, real(0.01), {}),
                              saved(folder / "b.safetensors", 2, real(0.4), real(0.02), kFeels)});
  const Committee both(files);
  constexpr Dim kWindows = 40;
  Tensor windows = uniform({kWindows, 32, 16}, 5);
  for (std::size_t i = 0; i < windows.values().size(); ++i)  // far apart, or all are drawn alike
    windows.values()[i] *= static_cast<real>(i / 512);
  const Estimate all = both.estimate(windows);
  const Tensor recalled = Prepared(*files[0].model).estimate(windows).picture,
               felt = Prepared(*files[1].model).estimate(windows).picture;
  std::size_t unfamiliar = 0;
  for (std::size_t n = 0; n < kWindows; ++n) {
    Tensor alone(Shape{1, 32, 16});
    std::ranges::copy(windows.values().subspan(n * 512, 512), alone.values().begin());
    const Estimate one = both.estimate(alone);
    ASSERT_EQ(one.unfamiliar.item(), all.unfamiliar.values()[n]) << n;
    const auto expected = (all.unfamiliar.values()[n] != 0 ? felt : recalled).values().subspan(n * 64, 64);
    EXPECT_TRUE(std::ranges::equal(all.picture.values().subspan(n * 64, 64), expected)) << n;
    EXPECT_TRUE(std::ranges::equal(one.picture.values(), expected)) << n;
    unfamiliar += all.unfamiliar.values()[n] != 0 ? 1 : 0;
  }
  EXPECT_GT(unfamiliar, 0U) << "nothing was felt, so nothing was chosen";
  EXPECT_LT(unfamiliar, std::size_t{kWindows}) << "nothing was recalled, so nothing was chosen";
}

TEST(Committee, OfFeelingNetworksAloneIsTheirMean) {
  const TemporaryFolder folder;
  const std::vector<ModelFile> files =
      load_models(std::vector{saved(folder / "a.safetensors", 1, real(0.2), real(0.1), kFeels),
                              saved(folder / "b.safetensors", 2, real(0.6), real(0.1), kFeels)});
  const Estimate mean = Committee(files).estimate(Tensor::full({1, 32, 16}, real(0.4)));
  EXPECT_FALSE(mean.unfamiliar.defined());
  EXPECT_FLOAT_EQ(mean.picture.values()[0], real(0.4));
}

void expect_refused(const std::vector<std::string>& paths, const std::string& why) {
  try {
    load_models(paths);
    FAIL() << "taken in spite of: " << why;
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find(why), std::string::npos) << error.what();
  }
}

TEST(Committee, SaysWhichModelsDoNotBelongTogether) {
  EXPECT_THROW(Committee(std::span<const ModelFile>()), std::invalid_argument);
  const TemporaryFolder folder;
  const std::string one = saved(folder / "a.safetensors", 1, {}, real(0.1), {}),
                    other = saved(folder / "b.safetensors", 1, {}, real(0.1), {}, 3),
                    feels = saved(folder / "c.safetensors", 1, {}, real(0.1), kFeels, 3);
  expect_refused({one, other}, "b.safetensors: its settings are");
  expect_refused({one, feels, other}, "differ in their seeds only");
  EXPECT_EQ(load_models(std::vector{one, feels, one, feels}).size(), 4U);
  InputSettings behind;
  behind.filter_s = 0.0992;
  const std::string filtered = folder / "filtered.safetensors";
  save_model(filtered, *load_model(one).model, behind, {});
  expect_refused({filtered, feels}, "that see the same windows");
  behind.filter_s.reset();
  save_model(filtered, *load_model(one).model, behind, {});
  EXPECT_EQ(load_models(std::vector{filtered, feels}).size(), 2U);
  InputSettings slower;
  slower.rate_hz = 100;
  const std::string slow = folder / "slow.safetensors", silent = folder / "silent.safetensors";
  save_model(slow, small_model(1), slower, kFeels);
  expect_refused({one, slow}, "that see the same windows");
  save_model(silent, small_model(1), {}, kFeels);
  expect_refused({one, silent}, "silent.safetensors: expected a model that draws how far off");
  save_model(slow, small_model(1), slower, {});
  save_model(silent, small_model(1), {}, {});
  expect_refused({silent, slow}, "slow.safetensors: its input are");
}

}  // namespace
}  // namespace supertac
