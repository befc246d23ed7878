#include "models/networks/supertac_model.h"

#include "models/networks/classifier.h"
#include "tests/models/support.h"
#include "tests/support/test.h"

namespace supertac::supertac_model_test {

TEST(SuperTac, PresetPaperHasTheParametersOfTheTable) {
  const SuperTac model = random_network(SuperTacSettings::of_preset("paper"));
  EXPECT_EQ(model.parameter_count(), 537810);
  std::set<std::string> names;
  for (const Parameter& p : model.parameters()) names.insert(p.name);
  EXPECT_EQ(names.size(), model.parameters().size());
  for (const char* name :
       {"encoder.0.conv.0.weight", "encoder.3.fc.bias", "encoder.2.mean.weight", "encoder.1.log_var.bias",
        "decoder.0.fc.1.weight", "decoder.3.conv.3.bias", "decoder.1.out.weight", "upsampler.fc.weight",
        "upsampler.rirb.1.rcab.2.conv.1.weight", "upsampler.rirb.0.rcab.0.attention.squeeze.weight",
        "upsampler.rirb.1.rcab.1.attention.expand.bias", "upsampler.rirb.1.conv.weight",
        "upsampler.rirb.0.up.weight", "upsampler.out.bias", "upsampler.spread.weight"}) {
    EXPECT_TRUE(names.contains(name)) << name;
  }
}

// No VAEs: the last frame's way alone, for arrays and pictures that windows do not have.
TEST(SuperTac, SingleFramesOfAnyArrayAtEveryScale) {
  for (const Dim scale : {2, 4, 8, 16}) {
    const SuperTac model = random_network({.rows = 2,
                                           .columns = 5,
                                           .in_channels = 3,
                                           .timesteps = 1,
                                           .scale = scale,
                                           .channels = 8,
                                           .rcabs = 1});
    EXPECT_EQ(model.infer(uniform({2, 1, 30}, 1)).shape(), (Shape{2, 2 * scale, 5 * scale, 1}));
    EXPECT_REFUSAL("SuperTac: windows expects [N,1,30], got [2,2,30]", model.infer(uniform({2, 2, 30}, 1)));
    EXPECT_REFUSAL(
        "SuperTac: encode() expects a model of windows, got one of single frames, which has no latents",
        (void)model.encode(uniform({2, 1, 30}, 1)));
    EXPECT_EQ(model.format().frames, 1);
    EXPECT_EQ(model.settings().latents(), 0);
    for (const Parameter& p : model.parameters()) EXPECT_TRUE(p.name.starts_with("upsampler.")) << p.name;
  }
}

// Every number of the windows is another one: where it goes shows where it came from.
TEST(SuperTac, GroupsOfAnyArrayHoldTheirTaxelsWithAllChannels) {
  SuperTacSettings s = small_settings();
  s.rows = 2, s.columns = 12, s.in_channels = 3;
  s.scale = 4;
  Tensor windows(Shape{1, 32, 72});
  for (Dim i = 0; i < windows.size(); ++i) windows.data()[i] = static_cast<real>(i) / (32 * 72);
  for (const Grouping grouping : {Grouping::horizontal, Grouping::vertical}) {
    s.grouping = grouping;
    const bool by_rows = grouping == Grouping::horizontal;
    const SuperTac model = random_network(s);
    EXPECT_EQ(s.groups(), by_rows ? 2 : 12);
    const std::vector<Tensor> eps(static_cast<std::size_t>(s.groups()), Tensor::zeros({1, 3}));
    const SuperTac::Output out = model.forward(windows, eps);
    ASSERT_EQ(out.decoded.size(), eps.size());
    EXPECT_EQ(out.picture.shape(), (Shape{1, 8, 48, 1}));
    for (std::size_t g = 0; g < eps.size(); ++g) {
      EXPECT_EQ(out.decoded[g].shape(), (Shape{1, 32, by_rows ? 36 : 6}));
      const real* found = out.input[g].value().data();
      for (Dim t = 0; t < 32; ++t) {
        for (Dim taxel = 0; taxel < (by_rows ? 12 : 2); ++taxel) {
          const Dim from = by_rows ? 12 * static_cast<Dim>(g) + taxel : 12 * taxel + static_cast<Dim>(g);
          for (Dim c = 0; c < 3; ++c) ASSERT_EQ(*found++, windows.data()[72 * t + 3 * from + c]);
        }
      }
    }
    EXPECT_EQ(model.encode(windows).shape(), (Shape{1, 3 * s.groups()}));
  }
}

TEST(SuperTac, RefusesSettingsAndWindowsThatDoNotFit) {
  const std::pair<SuperTacSettings, const char*> refused[] = {
      {{.timesteps = 40}, "timesteps expects a multiple of 16 (the encoder halves four times) or 1, got 40"},
      {{.timesteps = 1024}, "timesteps expects 32 to 512, got 1024"},
      {{.in_channels = 9}, "in_channels expects 1 to 8, got 9"},
      {{.latent = 0}, "latent expects 1 to 256, got 0"},
      {{.channels = 2}, "channels expects 4 to 256, got 2"},
      {{.rcabs = 17}, "rcabs expects 0 to 16, got 17"},
      {{.scale = 3}, "scale expects 2, 4, 8 or 16, got 3"},
      {{.columns = 65}, "columns expects 1 to 64, got 65"},
      {{.rows = 65, .timesteps = 1}, "rows expects 1 to 64, got 65"},
      {{.rows = 64, .columns = 64, .latent = 100},
       "latent of an array of 64x64 expects a layer of at most 2^28 weights, got 6400 latents; choose fewer "
       "latents or channels"},
      {{.rows = 1, .timesteps = 1, .scale = 2},
       "scale 2 of an array of 1x4 expects pictures of 3 to 1024 pixels a side, got 2x8"},
      {{.rows = 1, .columns = 64, .timesteps = 1, .scale = 2},
       "scale 2 of an array of 1x64 expects pictures of 3 to 1024 pixels a side, got 2x128"}};
  for (const auto& [settings, why] : refused)
    EXPECT_EQ(what_of<std::invalid_argument>([&, &s = settings] { random_network(s); }),
              "model settings: " + std::string(why));
  const SuperTac model = random_network();
  EXPECT_REFUSAL("SuperTac: windows expects [N,32,16], got [1,64,16]",
                 model.infer(Tensor::zeros({1, 64, 16})));
  EXPECT_REFUSAL("SuperTac: eps expects 4 tensors, got 0", model.forward(Tensor::zeros({1, 32, 16}), {}));
  EXPECT_REFUSAL("model settings: grouping expects horizontal or vertical, got \"diagonal\"",
                 grouping_of("diagonal"));
  EXPECT_REFUSAL("model settings: preset expects paper, tiny or frame, got \"huge\"",
                 SuperTacSettings::of_preset("huge"));
}

TEST(TextureClassifier, TakesFramesPicturesAndLatentsAndRefusesSettingsOutOfRange) {
  Rng rng(1);
  for (const ClassifierSettings& s :
       {ClassifierSettings{4, 4, 1, 6}, ClassifierSettings{16, 16, 1, 3}, ClassifierSettings{1, 1, 40, 4}})
    EXPECT_EQ(
        TextureClassifier(s, rng).forward(Variable(uniform({2, s.height, s.width, s.channels}, 1))).shape(),
        (Shape{2, s.classes}));
  EXPECT_REFUSAL("TextureClassifier: height expects 1 to 2048, got 0", TextureClassifier({.height = 0}, rng));
  EXPECT_REFUSAL("TextureClassifier: classes expects 2 to 1024, got 1",
                 TextureClassifier({.classes = 1}, rng));
}

}  // namespace supertac::supertac_model_test
