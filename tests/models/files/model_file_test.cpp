#include "models/files/model_file.h"

#include "tests/models/support.h"
#include "tests/support/test.h"

namespace supertac::model_file_test {

TEST(ModelFile, ComesBackWithItsSettingsInputAndPictures) {
  const TemporaryFolder folder;
  SuperTacSettings settings = small_settings();
  settings.grouping = Grouping::vertical;
  settings.last_frame_path = true;
  const SuperTac model = random_network(settings);
  save_model(folder / "m.safetensors", model,
             {.rate_hz = 300, .scaling = {2.5, 0.4, true}, .filter_s = 0.0992, .delay_s = 0.06},
             {{"split", "trial"}});
  const ModelFile file = load_model(folder / "m.safetensors");
  EXPECT_EQ(file.model->settings().grouping, Grouping::vertical);
  EXPECT_EQ(file.model->settings().latent, 3);
  EXPECT_TRUE(file.model->settings().last_frame_path);
  EXPECT_EQ(file.input.scaling.rest, 2.5);
  EXPECT_TRUE(file.input.scaling.per_window);
  EXPECT_EQ(file.input.filter_s, 0.0992);
  EXPECT_EQ(file.windows().delay_s, 0.06);
  EXPECT_EQ(file.metadata.at("split"), "trial");
  const Tensor x = uniform({2, 32, 16}, 1), a = model.infer(x), b = file.model->infer(x);
  EXPECT_TRUE(std::ranges::equal(a.values(), b.values()));
}

TEST(ModelFile, KeepsTheArrayAndSaysNothingOfTheRigs) {
  const TemporaryFolder folder;
  SuperTacSettings settings = small_settings();
  set_array(settings, {.rows = 5, .columns = 6, .channels = 3});
  const SuperTac model = random_network(settings);
  save_model(folder / "m.safetensors", model, {.scaling = {}, .pitch_mm = 2.5}, {});
  const ModelFile file = load_model(folder / "m.safetensors");
  EXPECT_EQ(file.array(), (TaxelArray{5, 6, 2.5, 3}));
  EXPECT_EQ(file.windows().array->picture(2), (ImageGrid{10, 12, 1.25}));
  const Tensor x = uniform({2, 32, 90}, 1), a = model.infer(x), b = file.model->infer(x);
  EXPECT_TRUE(std::ranges::equal(a.values(), b.values()));
  const auto rigs = model_metadata(small_settings(), {});
  EXPECT_EQ(rigs.at("settings").find("rows"), std::string::npos);
  EXPECT_EQ(rigs.at("input").find("pitch"), std::string::npos);
  EXPECT_EQ(rigs.at("input").find("delay"), std::string::npos);
}

// A file of version 1, to be read for ever: settings, names, layouts and what they compute.
TEST(ModelFile, ReadsTheGoldenFileOfVersion1) {
  const ModelFile file = load_model(std::string(SUPERTAC_GOLDEN_DIR) + "/model_v1.safetensors");
  EXPECT_EQ(file.model->settings().channels, 4);
  EXPECT_FALSE(file.input.scaling.per_window) << "a setting younger than the file";
  EXPECT_EQ(file.model->settings().grouping, Grouping::vertical);
  const Tensor picture = file.model->infer(uniform({1, 32, 16}, 1));
  EXPECT_NEAR(picture.data()[0], 0.116217159, 1e-6);
  EXPECT_NEAR(picture.data()[9], 0.15846996, 1e-6);
  EXPECT_NEAR(picture.data()[27], 0.122343943, 1e-6);
  EXPECT_NEAR(picture.data()[63], 0.103620872, 1e-6);
}

// What a file says never sizes anything, and what is gone is refused by name.
TEST(ModelFile, IsRefusedForWhatItSays) {
  const TemporaryFolder folder;
  const std::string path = folder / "m.safetensors";
  const SuperTac model = random_network();
  const auto error_of = [&](const std::map<std::string, std::string>& metadata) {
    write_checkpoint(path, model.parameters(), metadata);
    return what_of<std::runtime_error>([&] { (void)load_model(path); });
  };
  const std::string input = R"({"rate_hz":300,"rest_volts":2.45,"span_volts":0.36,"filter_s":0})";
  const auto settings = [](const std::string& timesteps, const std::string& latent,
                           const std::string& more = "") {
    return R"({"preset":"paper","timesteps":)" + timesteps + R"(,"latent":)" + latent +
           R"(,"scale":2,"grouping":"horizontal","channels":8,"rcabs":1)" + more + "}";
  };
  EXPECT_EQ(error_of({{"settings", settings("32", "3")}, {"input", input}}), "nothing thrown");
  const std::pair<std::map<std::string, std::string>, const char*> cases[] = {
      {{{"settings", settings("1000000", "3")}, {"input", input}},
       "timesteps expects 32 to 512, got 1000000"},
      {{{"settings", settings("32", "1e300")}, {"input", input}}, "\"latent\" must be a whole number"},
      {{{"settings", settings("32", "4")}, {"input", input}},
       "encoder.0.mean.weight expected F32 [4,64], found F32 [3,64]"},
      {{{"settings", "[[[["}, {"input", input}}, "metadata \"settings\""},
      {{{"settings", settings("32", "3")},
        {"input", R"({"rate_hz":300,"rest_volts":2.45,"span_volts":0,"filter_s":null})"}},
       "|span_volts| 1e-6 to 2e9, filter_s 0 to 10"},
      {{{"settings", settings("32", "3", R"(,"sub_pixel":true)")}},
       ": metadata \"settings\": expected transposed convolution, found \"sub_pixel\", which SuperTac no "
       "longer computes (22 % slower, no more accurate); train the model again"},
      {{{"kind", "frame-checkpoint"}, {"settings", "{}"}},
       ": is a frame model of supertac-train --pairs, which is gone; turn its pairs into recordings "
       "(supertac-import FILE.safetensors --out DIR) and train again (supertac-train --data DIR --preset "
       "frame)"},
      {{{"kind", "cheese"}}, ": expected a model, found kind 'cheese'"}};
  for (const auto& [metadata, refusal] : cases) {
    const std::string error = error_of(metadata);
    EXPECT_TRUE(error.starts_with(path) && error.find(refusal) != std::string::npos) << error;
  }
}

TEST(ModelFile, KnowsWhichFilterSignalsStillNeed) {
  const InputSettings filtered{100, {}, 0.1}, raw{100, {}, 0.0}, mixed{100, {}, std::nullopt};
  EXPECT_EQ(filtered.filter_left(0), 0.1);
  EXPECT_EQ(filtered.filter_left(0.10005), 0.0);
  EXPECT_EQ(filtered.filter_left(0.05), std::nullopt);
  EXPECT_EQ(raw.filter_left(0), 0.0);
  EXPECT_EQ(raw.filter_left(0.1), std::nullopt);
  EXPECT_EQ(mixed.filter_left(0.1), 0.0);
  EXPECT_EQ(mixed.filter_left(0), 0.0);
}

}  // namespace supertac::model_file_test
