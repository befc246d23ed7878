#include "models/inference/compiled/compiled_model.h"

#include "tests/models/support.h"
#include "tests/support/test.h"

namespace supertac::ensemble_test {

// Where members differ, the ensemble is less sure than any of them.
TEST(Ensemble, AveragesPicturesAndAddsTheirVarianceToPredictedErrors) {
  const TemporaryFolder folder;
  const std::vector<std::string> paths{folder / "a.safetensors", folder / "b.safetensors"};
  const Tensor windows = Tensor::full({3, 32, 16}, real(0.4));
  SuperTacSettings settings = small_settings();
  for (const bool predicts : {false, true}) {
    settings.predicted_error = predicts;
    for (std::uint64_t m = 0; m < 2; ++m) save_model(paths[m], random_network(settings, m + 1), {}, {});
    const std::vector<ModelFile> files = load_models(paths);
    const Estimate a = CompiledModel(*files[0].model).estimate(windows),
                   b = CompiledModel(*files[1].model).estimate(windows),
                   both = ensemble_of(files).estimate(windows);
    EXPECT_TRUE(std::ranges::equal(Ensemble({CompiledModel(*files[0].model)}).infer(windows).values(),
                                   a.picture.values()));
    ASSERT_EQ(both.picture.shape(), a.picture.shape());
    ASSERT_EQ(both.predicted_error.defined(), predicts);
    double difference = 0;
    for (std::size_t i = 0; i < a.picture.values().size(); ++i) {
      EXPECT_FLOAT_EQ(both.picture.values()[i], (a.picture.values()[i] + b.picture.values()[i]) / 2);
      const double half = (a.picture.values()[i] - b.picture.values()[i]) / 2;
      difference += std::abs(half);
      if (!predicts) continue;
      const double squares =
          (std::pow(a.predicted_error.values()[i], 2) + std::pow(b.predicted_error.values()[i], 2)) / 2;
      EXPECT_NEAR(both.predicted_error.values()[i], std::sqrt(squares + half * half), 1e-5);
    }
    EXPECT_GT(difference, 0) << "the two seeds draw the same, so nothing was averaged";
  }
}

void expect_refused(const std::vector<std::string>& paths, const std::string& why) {
  EXPECT_ERROR(load_models(paths), std::runtime_error, why);
}

TEST(Ensemble, SaysWhichModelsDoNotBelongTogether) {
  EXPECT_REFUSAL("Ensemble: expected at least one network, got none", Ensemble({}));
  const TemporaryFolder folder;
  const auto saved = [&](const char* name, const SuperTacSettings& settings, double rate_hz = 300,
                         const std::map<std::string, std::string>& metadata = {}) {
    save_model(folder / name, random_network(settings), {.rate_hz = rate_hz, .scaling = {}}, metadata);
    return folder / name;
  };
  const SuperTacSettings small = small_settings();
  SuperTacSettings larger = small, unsure = small, fine = small;
  larger.latent = 5, unsure.predicted_error = true, fine.scale = 4;
  const std::string one = saved("a.safetensors", small);
  EXPECT_EQ(load_models(std::vector{one, saved("larger.safetensors", larger)}).size(), 2U)
      << "their size does not matter";
  EXPECT_EQ(load_models(std::vector{one, saved("random.safetensors", small, 300, {{"random_plates", "100"}})})
                .size(),
            2U)
      << "what they were trained on does not matter";
  expect_refused({one, saved("unsure.safetensors", unsure)}, "unsure.safetensors: its settings are");
  expect_refused({one, saved("fine.safetensors", fine)}, "fine.safetensors: its settings are");
  expect_refused({one, saved("slow.safetensors", small, 100)}, "slow.safetensors: its input are");
}

TEST(Ensemble, RefusesNetworksOfOtherInputs) {
  SuperTacSettings twice_as_long = small_settings();
  twice_as_long.timesteps = 64;
  const SuperTac one = random_network(), longer = random_network(twice_as_long);
  EXPECT_REFUSAL(
      "Ensemble: expected networks of one format, got one of 32 frame(s) of 4x4 taxels with 1 channel(s) and "
      "pictures of 8x8 and one of 64 frame(s) of 4x4 taxels with 1 channel(s) and pictures of 8x8",
      Ensemble({CompiledModel(one), CompiledModel(longer)}));
}

}  // namespace supertac::ensemble_test
