#include "data/samples/random_passes.h"

#include <gtest/gtest.h>

#include <array>

#include "data/recordings/simulator.h"
#include "data/samples/split.h"

namespace supertac {
namespace {

WindowSettings small() {
  WindowSettings settings;
  settings.timesteps = 32;
  settings.rate_hz = 50;
  settings.stride = 10;
  return settings;
}

TEST(RandomPasses, AreTheSameForTheSameSeedAndOthersForAnother) {
  WindowSet a(small()), b(small()), c(small());
  add_random_passes(a, {.count = 3, .seed = 5});
  add_random_passes(b, {.count = 3, .seed = 5});
  add_random_passes(c, {.count = 3, .seed = 6});
  EXPECT_GT(a.size(), 100U);
  EXPECT_EQ(a.fingerprint(), b.fingerprint());
  EXPECT_NE(a.fingerprint(), c.fingerprint());
  EXPECT_EQ(a.fingerprint(), "5a2c8c98b7d2ce03");  // for ever: trainings are repeated from their seed
  for (const WindowSet::Pass& pass : a.passes()) EXPECT_TRUE(pass.plate.starts_with("random15000"));
}

TEST(RandomPasses, AreTrainedOnAsTheyAreAndNeverTested) {
  WindowSet windows(small());
  for (const int trial : {1, 2}) windows.add(simulate_pass(Plate::named("3_Bumps"), {.trial = trial}));
  const std::size_t own = windows.size();
  add_random_passes(windows, {.count = 4, .seed = 0});
  const Split split = make_split(windows, SplitKind::trial, 0);
  for (const std::uint32_t i : split.test) EXPECT_LT(i, own);
  EXPECT_GT(split.train.size(), own / 2 + 100);
  EXPECT_TRUE(windows.may_vary(0));
  EXPECT_FALSE(windows.may_vary(own));
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

}  // namespace
}  // namespace supertac
