#include "data/windows/live_window.h"

#include "data/simulation/simulator.h"
#include "data/windows/transforms.h"
#include "data/windows/windows.h"
#include "io/numbers/random.h"
#include "tests/data/test_recordings.h"
#include "tests/support/test.h"

namespace supertac::live_window_test {

constexpr int kTimesteps = 16;
const Scaling kWide{.rest = 3.0, .span = 2.0};

std::span<const float, rig::kTaxels> volts_of(const Recording& recording, std::size_t frame) {
  return std::span(recording.signals).subspan(frame * rig::kTaxels).first<rig::kTaxels>();
}

LiveWindowSettings live_settings(double sensor_rate_hz) {
  return {.timesteps = kTimesteps, .scaling = kWide, .frame_period_s = 1 / sensor_rate_hz};
}

using Window = std::vector<float>;

// Feeds a recording frame by frame; `use` sees what is known after each of them.
void feed(LiveWindow& live, const Recording& recording,
          const std::function<void(std::size_t frame)>& use = {}) {
  for (std::size_t i = 0; i < recording.frames(); ++i) {
    live.push(recording.time_s[i], volts_of(recording, i));
    if (use) use(i);
  }
}

Recording first_frames(const Recording& whole, std::size_t frames) {
  Recording part;
  part.time_s.assign(whole.time_s.begin(), whole.time_s.begin() + static_cast<std::ptrdiff_t>(frames));
  part.signals.assign(whole.signals.begin(),
                      whole.signals.begin() + static_cast<std::ptrdiff_t>(frames * rig::kTaxels));
  return part;
}

// After every frame the window is the end of a recording that ends there, and that of the whole recording in
// WindowSet once the frame is the last of its sample. Returns how many of these there were.
std::size_t expect_windows_of_set(const Recording& recording, LiveWindow live, bool per_window = false) {
  WindowSettings settings = wide_settings(kTimesteps);
  settings.scaling.per_window = per_window;
  Recording sliding = recording;
  sliding.lift_mm.clear();  // or frames between air and plate would end no window
  WindowSet set(settings);
  set.add(sliding);
  const auto track_of = [&](std::size_t frames) {
    return resample(first_frames(recording, frames), {.scaling = kWide});
  };
  std::size_t next = 0, complete = 0;
  Window window(kTimesteps * rig::kTaxels), expected(window.size());
  Track track = track_of(1);
  feed(live, recording, [&](std::size_t frame) {
    const bool due = track.run.back() >= kTimesteps;
    ASSERT_EQ(live.window(window), due) << "frame " << frame;
    const std::size_t sample = track.frames() - 1;
    if (due) {
      expected.assign(track.samples.end() - static_cast<std::ptrdiff_t>(window.size()), track.samples.end());
      if (per_window) normalise_window(expected, rig::kTaxels);
      ASSERT_EQ(window, expected) << "frame " << frame;
    }
    const bool last = frame + 1 == recording.frames();
    if (!last) track = track_of(frame + 2);
    if (!due || (!last && track.frames() == sample + 1)) return;
    while (set.frame_of(next) < sample) ++next;
    ASSERT_EQ(set.frame_of(next), sample);
    set.window(next, expected);
    ASSERT_EQ(window, expected) << "window " << next;
    ++complete;
  });
  return complete;
}

// A recording as a sensor makes it: jitter, lost frames, a gap; signals without any pattern.
Recording rough_recording(double rate_hz, double lost, std::uint64_t seed) {
  const RandomStream random(seed, 1);
  const Recording smooth =
      make_recording({.frames = static_cast<std::size_t>(2 * rate_hz), .rate_hz = rate_hz});
  Recording rough = smooth;
  rough.time_s.clear(), rough.signals.clear(), rough.position_mm.clear();
  for (std::size_t i = 0; i < smooth.frames(); ++i) {
    if (random.uniform(3 * i) < lost) continue;
    const double gap = i > smooth.frames() / 2 ? 0.3 : 0;
    rough.time_s.push_back(smooth.time_s[i] + gap + 0.4 * (random.uniform(3 * i + 1) - 0.5) / rate_hz);
    for (int k = 0; k < rig::kTaxels; ++k)
      rough.signals.push_back(1 + 2 * static_cast<float>(random.uniform(1000 + rig::kTaxels * i + k)));
    rough.position_mm.insert(rough.position_mm.end(), {18.0F, 30.0F});
  }
  return rough;
}

TEST(LiveWindow, GivesTheWindowsOfTrainingBitForBit) {
  for (const double rate : {300.0, 783.7, 1008.0645161290322, 150.0, 130.0}) {
    for (const double lost : {0.0, 0.05, 0.4}) {
      const Recording recording = rough_recording(rate, lost, 5);
      const std::size_t windows = expect_windows_of_set(recording, LiveWindow(live_settings(rate)));
      EXPECT_GT(windows, 0.7 * (1 - lost) * 2 * std::min(rate, 300.0) - 40)
          << rate << " Hz, " << lost << " lost";
    }
  }
}

TEST(LiveWindow, IsNormalisedLikeOneOfTraining) {
  const Recording recording = rough_recording(300, 0.05, 5);
  LiveWindowSettings settings = live_settings(300);
  settings.scaling.per_window = true;
  EXPECT_GT(expect_windows_of_set(recording, LiveWindow(settings), true), 400U);
}

// Three or four frames in each sample: the newest sample is the mean of those that have come.
TEST(LiveWindow, OneForEveryFrameOfTheBoardWhateverThePhase) {
  const std::vector<double> times{0, 0.001, 0.002, 0.003, 0.004};
  LiveWindow live({.timesteps = 2, .signals = 1, .scaling = kWide, .frame_period_s = 0.001});
  const std::vector<std::vector<float>> expected{{}, {}, {0.925F, 0.7F}, {0.925F, 0.675F}, {0.925F, 0.65F}};
  for (std::size_t i = 0; i < times.size(); ++i) {
    const float volts = 1.1F + 0.1F * static_cast<float>(i) + (i > 1 ? 0.3F : 0);
    live.push(times[i], std::span(&volts, 1));
    Window window(2);
    ASSERT_EQ(live.window(window), i >= 2) << i;
    for (std::size_t n = 0; i >= 2 && n < 2; ++n)
      EXPECT_NEAR(window[n], expected[i][n], 1e-6) << i << " " << n;
  }
}

// A frame a second for a model of 300 samples a second: nearly all samples repeat the one before.
TEST(LiveWindow, HoldsMoreSamplesThanAWindowHas) {
  LiveWindow live({.timesteps = 16, .signals = 1, .scaling = kWide, .frame_period_s = 1});
  Window window(16);
  for (const float volts : {1.0F, 2.0F, 1.5F})
    live.push(volts == 1 ? 0 : volts == 2 ? 1 : 2, std::span(&volts, 1));
  ASSERT_TRUE(live.window(window));
  EXPECT_EQ(window, (Window{0.5F, 0.5F, 0.5F, 0.5F, 0.5F, 0.5F, 0.5F, 0.5F, 0.5F, 0.5F, 0.5F, 0.5F, 0.5F,
                            0.5F, 0.5F, 0.75F}));
}

TEST(LiveWindow, AppliesTheMovingAverageOfTraining) {
  SimulatorSettings filtered;
  filtered.lost_fraction = 0, filtered.with_saturation = false;
  SimulatorSettings unfiltered = filtered;
  unfiltered.filter_s = 0;
  const Plate plate = Plate::named("bumps12");
  const Recording truth = simulate_pass(plate, {.to_mm = 36}, filtered);
  const Recording raw = simulate_pass(plate, {.to_mm = 36}, unfiltered);
  LiveWindow with_filter({.timesteps = kTimesteps, .filter_s = filtered.filter_s});
  LiveWindow without({.timesteps = kTimesteps});
  Window expected(kTimesteps * rig::kTaxels), window(kTimesteps * rig::kTaxels);
  for (std::size_t i = 0; i < truth.frames(); ++i) {
    with_filter.push(raw.time_s[i], volts_of(raw, i));
    without.push(truth.time_s[i], volts_of(truth, i));
    ASSERT_EQ(without.window(expected), with_filter.window(window));
    if (i + 1 < kTimesteps) continue;
    for (std::size_t n = 0; n < window.size(); ++n) ASSERT_NEAR(window[n], expected[n], 2e-6) << i;
  }
}

TEST(LiveWindow, StartsAnewAfterAGapEvenOneLongerThanTheWindow) {
  for (const double gap : {0.06, 10.0}) {
    Recording recording = make_recording({.frames = 60});
    for (std::size_t i = 30; i < 60; ++i) recording.time_s[i] += gap;
    LiveWindow live(live_settings(300));
    Window window(kTimesteps * rig::kTaxels);
    feed(live, recording, [&](std::size_t frame) {
      const bool spans = frame < 30 ? frame >= 15 : frame >= 45;
      EXPECT_EQ(live.window(window), spans) << "frame " << frame << ", gap " << gap;
    });
    EXPECT_EQ(live.gaps(), 1U);
    EXPECT_EQ(window[0], kWide(recording.signals[44 * rig::kTaxels]));
  }
}

TEST(LiveWindow, AFrameThatIsNotLaterIsLeftOutAClockSetBackStartsAnew) {
  const Recording recording = make_recording({.frames = 40});
  LiveWindow live(live_settings(300));
  feed(live, recording);
  Window before(kTimesteps * rig::kTaxels), after(kTimesteps * rig::kTaxels);
  ASSERT_TRUE(live.window(before));
  live.push(recording.time_s[39], volts_of(recording, 0));
  live.push(recording.time_s[37], volts_of(recording, 0));
  ASSERT_TRUE(live.window(after));
  EXPECT_EQ(before, after);
  live.push(recording.time_s[0] - 1, volts_of(recording, 0));
  EXPECT_EQ(live.gaps(), 1U);
  EXPECT_FALSE(live.window(after));
}

TEST(LiveWindow, TakesADamagedFrameAsLost) {
  const Recording recording = make_recording({.frames = 40});
  LiveWindow live(live_settings(300));
  std::array<float, rig::kTaxels> damaged{};
  damaged[7] = std::numeric_limits<float>::quiet_NaN();
  feed(live, recording, [&](std::size_t i) { live.push(recording.time_s[i] + 1e-3, damaged); });
  live.push(std::numeric_limits<double>::infinity(), volts_of(recording, 0));
  Window window(kTimesteps * rig::kTaxels), expected(window.size());
  ASSERT_TRUE(live.window(window));
  LiveWindow whole(live_settings(300));
  feed(whole, recording);
  ASSERT_TRUE(whole.window(expected));
  EXPECT_EQ(window, expected);
}

TEST(LiveWindow, RefusesAWrongRoom) {
  LiveWindow live(live_settings(300));
  Window small(10);
  EXPECT_REFUSAL("live window: window expects 256 values, got 10", live.window(small));
}

}  // namespace supertac::live_window_test
