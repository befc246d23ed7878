#include "models/training/recipe.h"

#include "models/files/model_file.h"
#include "tests/models/support.h"
#include "tests/support/test.h"

namespace supertac::recipe_test {

// What a model trained by this recipe says of itself.
ModelFile file_of(const Recipe& recipe, const std::string& path) {
  InputSettings input{
      .rate_hz = recipe.rate_hz, .scaling = recipe.range.value_or(Scaling()), .delay_s = recipe.delay_s};
  input.scaling.per_window = recipe.per_window;
  save_model(path, random_network(recipe.model), input, metadata_of(recipe));
  return load_model(path);
}

TEST(Recipe, ComesBackFromTheModelFile) {
  const TemporaryFolder folder;
  for (const char* name : {"paper", "tiny", "best"}) {
    Recipe recipe = Recipe::named(name == std::string("best") ? "paper" : name);
    if (name == std::string("best")) {  // a recipe that is no longer named
      recipe.model.preset = name;
      recipe.sampling = false, recipe.loss.beta = 0, recipe.muon = true;
    }
    recipe.model.latent = 3, recipe.model.channels = 8, recipe.model.rcabs = 1;
    recipe.epochs = 7, recipe.batch = 16, recipe.seed = 12'345'678'901;
    recipe.loss.lambda = 0.25;
    recipe.plates = {"3_Bumps", "4_Ridges"}, recipe.leave_out = {"4_Ridges"};
    recipe.split = SplitKind::texture;
    recipe.delay_s = 0.5, recipe.stride = 4, recipe.random_plates = 9,
    recipe.interval_factor = PixelInterval{0.5, 3};
    recipe.range = Scaling{.rest = 2, .span = 0.5};
    recipe.augment.dropped = 1;
    const std::string path = folder / (std::string(name) + ".safetensors");
    const Recipe back = Recipe::of(file_of(recipe, path));
    EXPECT_EQ(metadata_of(back), metadata_of(recipe)) << name;
    EXPECT_EQ(model_metadata(back.model, {}), model_metadata(recipe.model, {})) << name;
    EXPECT_EQ(back.rate_hz, recipe.rate_hz);
    EXPECT_EQ(back.delay_s, 0.5);
    EXPECT_EQ(back.range->span, 0.5);
    EXPECT_EQ(back.sampling, recipe.sampling);
    EXPECT_EQ(back.muon, recipe.muon);
  }
}

TEST(Recipe, NamedOnesSeeTwoAndAHalfSeconds) {
  for (const char* name : {"paper", "tiny"}) {
    const Recipe recipe = Recipe::named(name);
    EXPECT_DOUBLE_EQ(static_cast<double>(recipe.model.timesteps) / recipe.rate_hz, 2.56) << name;
    EXPECT_EQ(recipe.model.preset, name);
    EXPECT_NO_THROW(recipe.check());
  }
  const Recipe paper = Recipe::named("paper"), tiny = Recipe::named("tiny");
  EXPECT_TRUE(paper.sampling && !paper.muon);
  EXPECT_LT(2 * tiny.rate_hz * static_cast<double>(tiny.epochs) / 9,
            paper.rate_hz * static_cast<double>(paper.epochs))
      << "half the work of a training of paper";
  EXPECT_REFUSAL("model settings: preset expects paper, tiny or frame, got \"small\"",
                 Recipe::named("small"));
}

TEST(Recipe, RefusesWhatNoTrainingHas) {
  const std::pair<void (*)(Recipe&), const char*> cases[] = {
      {[](Recipe& r) { r.stride = 0; }, "recipe: stride expects 1 to 100000, got 0"},
      {[](Recipe& r) { r.delay_s = 2.56; },
       "recipe: delay_s expects 0 to less than the window lasts, got 2.56"},
      {[](Recipe& r) { r.rate_hz = 5; }, "recipe: rate_hz expects 20 to 2000, got 5"},
      {[](Recipe& r) { r.random_plates = -1; }, "recipe: random_plates expects 0 to 50000, got -1"},
      {[](Recipe& r) { r.range = Scaling{.rest = 1, .span = 0}; },
       "recipe: range expects a span that is not 0, got 0"},
      {[](Recipe& r) { r.leave_out = {"3_Bumps"}; }, "--split texture"},
      {[](Recipe& r) { r.epochs = 0; }, "recipe: epochs expects 1 to 100000, got 0"},
      {[](Recipe& r) { r.batch = 5000; }, "recipe: batch expects 1 to 4096, got 5000"},
      {[](Recipe& r) { r.learning_rate = 2; },
       "recipe: learning_rate expects more than 0 and at most 1, got 2"},
      {[](Recipe& r) { r.warm_up = 1; }, "recipe: warm_up expects a share of all steps, 0 to below 1, got 1"},
      {[](Recipe& r) { r.clip_norm = -1; }, "recipe: clip_norm expects 0 (never) or more, got -1"},
      {[](Recipe& r) { r.loss.beta = -1; }, "beta expects 0 or more, got -1"},
      {[](Recipe& r) { r.model.latent = 0; }, "latent"}};
  for (const auto& [spoil, said] : cases) {
    Recipe recipe = Recipe::named("tiny");
    spoil(recipe);
    EXPECT_ERROR(recipe.check(), std::invalid_argument, said);
  }
}

TEST(Recipe, AFileThatDoesNotSayItIsRefusedByName) {
  const TemporaryFolder folder;
  const std::string path = folder / "old.safetensors";
  save_model(path, random_network(), {}, {{"seed", "1"}});
  EXPECT_ERROR(Recipe::of(load_model(path)), std::runtime_error, path + ": metadata \"training\" is missing");
}

}  // namespace supertac::recipe_test
