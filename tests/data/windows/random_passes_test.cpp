#include "data/windows/random_passes.h"

#include "data/simulation/simulator.h"
#include "data/windows/split.h"
#include "tests/support/test.h"

namespace supertac::random_passes_test {

WindowSettings small() {
  WindowSettings settings;
  settings.timesteps = 32;
  settings.rate_hz = 50;
  settings.stride = 10;
  return settings;
}

TEST(RandomPasses, AreTheSameForTheSameSeedAndOthersForAnother) {
  WindowSet a(small()), c(small());
  add_random_passes(a, {.count = 3, .seed = 5});
  add_random_passes(c, {.count = 3, .seed = 6});
  EXPECT_GT(a.size(), 100U);
  EXPECT_NE(a.fingerprint(), c.fingerprint());
  EXPECT_EQ(a.fingerprint(), "5a2c8c98b7d2ce03");  // for ever: trainings are repeated from their seed
  WindowSet others(small());
  add_random_passes(others, {.count = 3, .seed = 5, .other_fingers = true});
  EXPECT_EQ(others.fingerprint(), "d6ba3f805fb91005");
  for (const WindowSet::Pass& pass : a.passes()) {
    EXPECT_TRUE(pass.plate.starts_with("random15000"));
    EXPECT_TRUE(pass.use.training_only && !pass.use.augmentable);
  }
}

// The whole pass: in the air, on the flat plate, over texture.
TEST(RandomPasses, ShowEveryZone) {
  WindowSet windows(small());
  add_random_passes(windows, {.count = 6, .seed = 1});
  std::array<int, 4> zones{};
  for (std::size_t i = 0; i < windows.size(); ++i) ++zones[static_cast<std::size_t>(windows.zone(i))];
  for (const Zone zone : {Zone::contact, Zone::flat, Zone::air})
    EXPECT_GT(zones[static_cast<std::size_t>(zone)], 30) << static_cast<int>(zone);
}

// So many windows of one pass, again and again, that any number of silent ones may be shown beside them.
WindowSet many(WindowSettings settings, std::size_t count) {
  settings.stride = 1;
  WindowSet windows(settings);
  Recording pass = simulate_pass(Plate::named("3_Bumps"), {});
  pass.array = settings.array.value_or(pass.array);
  pass.signals.resize(pass.time_s.size() * pass.array.signals());
  while (windows.size() < count) windows.add(pass);
  return windows;
}

TEST(SilentPasses, AreATenthOfTheOthersAndUnlessManyAreWantedNeverMoreThan2400Windows) {
  for (const bool wanted : {false, true})
    for (const std::size_t count : {1U, 3000U, 60'000U}) {
      WindowSet windows = many(small(), count);
      const auto own = static_cast<double>(windows.size());
      add_silent_passes(windows, 0, wanted);
      EXPECT_NEAR(static_cast<double>(windows.size()) - own, wanted ? own / 10 : std::min(2400.0, own / 10),
                  0.2 * own / 10);
    }
  WindowSet nothing(small());
  add_silent_passes(nothing, 0);
  EXPECT_EQ(nothing.size(), 0U);
}

// A sensor's own frames go through the filter that the training signals went through: it must be known.
TEST(SilentPasses, LeaveTheFilterOfTheOthersKnown) {
  WindowSet windows = many(small(), 3000);
  const std::size_t own = windows.passes().size();
  add_silent_passes(windows, 0);
  ASSERT_GT(windows.passes().size(), own);
  EXPECT_EQ(windows.filter_s(), SimulatorSettings().filter_s);
  Recording other = simulate_pass(Plate::named("3_Bumps"), {});
  other.metadata["filter_s"] = "0.05";
  windows.add(other);
  EXPECT_EQ(windows.filter_s(), std::nullopt);
}

// Signals that stand, drift or are noisy, with the truth of a plain plate.
TEST(SilentPasses, ShowNothingAndAreNotUsual) {
  WindowSet windows = many(small(), 24'000);
  const std::size_t own = windows.size();
  add_silent_passes(windows, 0);
  const Split split = make_split(windows, SplitKind::none, 0);
  for (const std::uint32_t i : split.test) EXPECT_LT(i, own);
  EXPECT_GT(split.train.size(), own + 2000);
  EXPECT_TRUE(windows.in_distribution(0));
  std::vector<float> input(windows.input_size()), target(windows.image().pixels());
  int standing = 0, moving = 0;
  for (std::size_t i = own; i < windows.size(); ++i) {
    EXPECT_FALSE(windows.in_distribution(i) || windows.augmentable(i));
    EXPECT_EQ(windows.zone(i), Zone::flat);
    windows.truth(i, target);
    EXPECT_TRUE(std::ranges::all_of(target, [](float z) { return z == 0; }));
    windows.window(i, input);
    float most = 0;
    for (std::size_t k = 16; k < input.size(); ++k) most = std::max(most, std::abs(input[k] - input[k % 16]));
    (most < 0.01F ? standing : moving) += 1;
  }
  EXPECT_GT(standing, 20);
  EXPECT_GT(moving, 1000);
}

/// The median over passes [begin, end) of a set of the highest first sample.
float typical_level(const WindowSet& windows, std::size_t begin, std::size_t end) {
  std::vector<float> levels, input(windows.input_size());
  for (std::size_t pass = begin; pass < end; ++pass) {
    windows.window(windows.passes()[pass].first_window, input);
    levels.push_back(*std::max_element(input.begin(), input.begin() + rig::kTaxels));
  }
  std::ranges::sort(levels);
  return levels[levels.size() / 2];
}

TEST(SilentPasses, BeyondTheFirst300AreOfAFingerThatHardlyTouches) {
  WindowSettings settings = small();
  settings.scaling.per_window = false;
  WindowSet windows = many(settings, 60'000);
  const std::size_t own = windows.passes().size();
  add_silent_passes(windows, 0, true);
  ASSERT_GT(windows.passes().size(), own + 600);
  const float first = typical_level(windows, own, own + 300);
  const float rest = typical_level(windows, own + 300, windows.passes().size());
  EXPECT_GT(first, 0.15F);
  EXPECT_LT(rest, 0.7F * first);
}

TEST(SilentPasses, FollowTheSeedAndFitAnyArrayAndRange) {
  WindowSettings settings = small();
  settings.array = TaxelArray{.rows = 3, .columns = 5};
  settings.scaling = {.rest = 40, .span = 40};
  settings.scaling.per_window = false;
  const WindowSet others = many(settings, 24'000);
  WindowSet a = others, c = others;
  add_silent_passes(a, 5);
  add_silent_passes(c, 6);
  EXPECT_NE(a.fingerprint(), c.fingerprint());
  std::vector<float> input(a.input_size());
  float highest = 0;
  for (std::size_t i = others.size(); i < a.size(); ++i) {
    a.window(i, input);
    highest = std::max(highest, std::ranges::max(input));
  }
  EXPECT_GT(highest, 0.9F);
}

}  // namespace supertac::random_passes_test
