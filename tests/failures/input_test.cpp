// Failures 11 and 12: bad recordings, and splits that leak.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "data/windows/split.h"
#include "tests/models/support.h"

namespace supertac {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// A pass of `frames` samples over a bump plate; `spoil` may change it.
template <class F>
Recording recording(F spoil, int trial = 1, std::size_t frames = 150) {
  Recording r;
  r.plate = "3_Bumps";
  r.trial = trial;
  r.pass = 1;
  r.source = "simulated";
  for (std::size_t i = 0; i < frames; ++i) {
    const double t = static_cast<double>(i) / 300;
    r.time_s.push_back(t);
    r.position_mm.insert(r.position_mm.end(), {18, static_cast<float>(36 + 10 * t)});
    for (int k = 0; k < rig::kTaxels; ++k) {
      r.signals.push_back(static_cast<float>(2.3 + (0.1 + 0.01 * trial) * std::sin(20 * t + 0.3 * k)));
    }
  }
  spoil(r);
  return r;
}

WindowSet windows_of(const std::vector<Recording>& recordings, double max_gap_s = 0.05) {
  WindowSettings settings;
  settings.timesteps = 32;
  settings.scale = 2;
  settings.max_gap_s = max_gap_s;
  WindowSet windows(settings);
  for (const Recording& r : recordings) windows.add(r);
  return windows;
}

bool all_in_range(const WindowSet& windows) {
  for (std::size_t i = 0; i < windows.size(); ++i) {
    for (const float x : windows.window(i)) {
      if (!(x >= 0 && x <= 1)) return false;
    }
  }
  return true;
}

TEST(Failures, F11ANanInARecordingIsDroppedAndCounted) {
  const Recording spoilt = recording([](Recording& r) { r.signals[50 * rig::kTaxels + 3] = kNan; });
  const WindowSet windows = windows_of({spoilt});
  EXPECT_EQ(windows.counts().damaged, 1U);
  EXPECT_TRUE(all_in_range(windows));
  const TemporaryFolder folder;
  EXPECT_THROW(write_recording(folder / "nan.safetensors", spoilt), std::invalid_argument);
}

// What the check keeps out: one value makes the whole picture not a number.
TEST(Failures, F11ANanInAWindowReachesEveryPixel) {
  Rng rng(1);
  const SuperTac model(small_settings(), rng);
  Tensor window = uniform({1, 32, 16}, 1);
  window.data()[100] = kNan;
  for (const real x : model.infer(window).values()) EXPECT_TRUE(std::isnan(x));
}

TEST(Failures, F11VoltagesAThousandTimesTooLargeAreClipped) {
  const WindowSet windows = windows_of({recording([](Recording& r) {
    for (float& v : r.signals) v *= 1000;
  })});
  EXPECT_TRUE(all_in_range(windows));
}

TEST(Failures, F11ConstantClippedAndDeadSignalsTrainToFiniteNumbers) {
  const auto constant = [](Recording& r) { std::fill(r.signals.begin(), r.signals.end(), 2.4F); };
  const auto clipped = [](Recording& r) { std::fill(r.signals.begin(), r.signals.end(), 0.0F); };
  const auto dead_taxel = [](Recording& r) {
    for (std::size_t i = 5; i < r.signals.size(); i += rig::kTaxels) r.signals[i] = 2.46F;
  };
  const WindowSet windows =
      windows_of({recording(constant), recording(clipped, 2), recording(dead_taxel, 3)});
  Recipe settings = small_training();
  settings.epochs = 1;
  Trainer trainer(windows, all_of(windows), Objective(windows, settings));
  for (int i = 0; i < 10; ++i) EXPECT_TRUE(std::isfinite(trainer.train_step().total));
}

// A rate a hundred times too high: every loss is finite, or training says which step and layer was the end.
TEST(Failures, F3ARateAHundredTimesTooHighNeverTrainsOnNan) {
  const WindowSet windows = windows_of({recording([](Recording&) {}), recording([](Recording&) {}, 2)});
  Recipe settings = small_training();
  settings.learning_rate = 0.1;
  Trainer trainer(windows, all_of(windows), Objective(windows, settings));
  try {
    for (int i = 0; i < 40; ++i) ASSERT_TRUE(std::isfinite(trainer.train_step().total));
  } catch (const TrainingStopped& error) {
    EXPECT_NE(std::string(error.what()).find("; lower --learning-rate (now 0.1)"), std::string::npos);
  }
}

// Half a second without samples: a window across it would show a jump that no finger made.
TEST(Failures, F11NoWindowCrossesAGap) {
  const auto gap = [](Recording& r) {
    for (std::size_t i = 75; i < r.time_s.size(); ++i) r.time_s[i] += 0.5;
  };
  const WindowSet off = windows_of({recording(gap)}, 10), on = windows_of({recording(gap)});
  EXPECT_EQ(off.counts().gaps, 0U);
  EXPECT_GT(off.counts().held, 140U);  // the silence is filled with the last sample
  EXPECT_EQ(on.counts().gaps, 1U);
  EXPECT_EQ(on.counts().held, 0U);
  EXPECT_EQ(on.size(), 2 * (75 - 31U));
}

TEST(Failures, F12RandomWindowsLeakAndAnUnseenTrialDoesNot) {
  const WindowSet windows = windows_of({recording([](Recording&) {}), recording([](Recording&) {}, 2)});
  const Split off = make_split(windows, SplitKind::window, 0), on = make_split(windows, SplitKind::trial, 0);
  EXPECT_GT(count_overlapping(windows, off), off.test.size() * 9 / 10);
  EXPECT_EQ(count_overlapping(windows, on), 0U);
}

}  // namespace
}  // namespace supertac
