// Unit and polarity on the way from a recording to windows.

#include "data/recordings/resample.h"
#include "data/simulation/simulator.h"
#include "data/windows/random_passes.h"
#include "data/windows/windows.h"
#include "tests/support/test.h"

namespace supertac::units_test {

const SignalScale kCounts{.unit = "counts", .rest = 1000, .span = -16'000'000};

Recording volts() { return simulate_pass(Plate::named("bumps12"), {.to_mm = 50}); }

Recording counts() {
  Recording recording = volts();
  restate(recording, kCounts);
  return recording;
}

TEST(Units, CountsThatRiseGiveTheWindowsOfVoltsThatFall) {
  const Recording both[] = {volts(), counts()};
  std::vector<WindowSet> sets;
  for (const Recording& recording : both) {
    SignalRange range;
    range.add(recording);
    WindowSettings settings{.timesteps = 32, .scaling = range.fitted()};
    EXPECT_EQ(settings.scaling.rest, recording.signal_scale.rest);
    EXPECT_EQ(settings.scaling.span, recording.signal_scale.span);
    sets.emplace_back(settings).add(recording);
  }
  ASSERT_EQ(sets[0].size(), sets[1].size());
  float worst = 0, most = 0;
  for (std::size_t i = 0; i < sets[0].size(); ++i) {
    const std::vector<float> a = sets[0].raw_window(i), b = sets[1].raw_window(i);
    for (std::size_t k = 0; k < a.size(); ++k)
      worst = std::max(worst, std::abs(a[k] - b[k])), most = std::max(most, a[k]);
  }
  EXPECT_LT(worst, 2e-6F);
  EXPECT_GT(most, 0.3F);
}

TEST(Units, ARangeThatIsNotTheStatedOneIsFoundTheRightWayUp) {
  Recording recording = counts();
  recording.signal_scale.span = -1e9;  // the signals fill a sixtieth
  SignalRange range;
  range.add(recording);
  EXPECT_LT(range.fitted().span, 0);
  EXPECT_NEAR(range.fitted().rest, 1000, 1e6);
  EXPECT_LT(range.clipped(range.fitted()), 0.02);
}

TEST(Units, AFolderOfTwoIsRefusedByName) {
  const TemporaryFolder folder;
  write_recording(folder / "a.safetensors", volts());
  write_recording(folder / "b.safetensors", counts());
  EXPECT_EQ(
      what_of<std::runtime_error>([&] { WindowSet::load(folder.path(), {}, {.timesteps = 32}); }),
      folder / "b.safetensors" +
          ": has signals in 'counts' that rise under pressure, expected 'V' that fall under pressure, as "
          "in the others; give recordings of one sensor");
}

TEST(Units, RandomPassesSpeakTheSensorsLanguage) {
  const Recording recording = counts();
  WindowSet windows({.timesteps = 32, .scaling = {.rest = kCounts.rest, .span = kCounts.span}});
  windows.add(recording);
  const std::size_t before = windows.size();
  add_random_passes(windows, {.count = 2});
  ASSERT_GT(windows.size(), before);
  float most = 0;
  for (std::size_t i = before; i < windows.size(); i += 10)
    for (const float value : windows.raw_window(i)) most = std::max(most, value);
  EXPECT_GT(most, 0.2F);
  EXPECT_LT(most, 1.0F);
}

}  // namespace supertac::units_test
