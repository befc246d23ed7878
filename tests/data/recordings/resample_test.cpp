#include "data/recordings/resample.h"

#include "data/simulation/simulator.h"
#include "tests/data/test_recordings.h"
#include "tests/support/test.h"

namespace supertac::resample_test {

const ResampleSettings kWideRange{.scaling = Scaling{.rest = 3.0, .span = 2.0}};

void remove_frame(Recording& recording, std::size_t i) {
  const auto at = [i](auto& values, std::size_t n) {
    const auto first = values.begin() + static_cast<std::ptrdiff_t>(i * n);
    values.erase(first, first + static_cast<std::ptrdiff_t>(n));
  };
  at(recording.time_s, 1);
  at(recording.signals, rig::kTaxels);
  at(recording.position_mm, 2);
}

TEST(Scaling, MapsRestToZeroAndClips) {
  const Scaling scaling;
  EXPECT_NEAR(scaling(2.45F), 0, 1e-6);
  EXPECT_NEAR(scaling(2.09F), 1, 1e-6);
  EXPECT_NEAR(scaling(2.27F), 0.5, 1e-6);
  EXPECT_EQ(scaling(3.3F), 0);
  EXPECT_EQ(scaling(0), 1);
}

TEST(Resample, LeavesARecordingAtItsRateAsItIs) {
  const Recording recording = make_recording({});
  const Track track = resample(recording, kWideRange);
  ASSERT_EQ(track.frames(), recording.frames());
  for (std::size_t i = 0; i < recording.signals.size(); ++i)
    ASSERT_EQ(track.samples[i], kWideRange.scaling(recording.signals[i])) << i;
  for (std::size_t i = 0; i < recording.position_mm.size(); ++i)
    ASSERT_NEAR(track.position_mm[i], recording.position_mm[i], 1e-4) << i;
  EXPECT_EQ(track.held, 0U);
  EXPECT_EQ(track.gaps, 0U);
  EXPECT_EQ(track.run.back(), 100U);
}

TEST(Resample, AveragesWhatArrivedInAPeriod) {
  const Recording recording = make_recording({.frames = 901, .rate_hz = 900});
  const Track track = resample(recording, kWideRange);
  ASSERT_EQ(track.frames(), 301U);
  // Period 10 is centred on frame 30 and holds 29, 30, 31.
  EXPECT_NEAR(track.samples[10 * rig::kTaxels], kWideRange.scaling(2.0F + 0.030F), 1e-6);
  EXPECT_NEAR(track.position_mm[2 * 10 + 1], 30 + 10.0 * 10 / 300, 1e-5);
}

TEST(Resample, LooksNoFurtherAheadThanHalfAPeriod) {
  const Recording recording = make_recording({.frames = 901, .rate_hz = 900});
  Recording changed = recording;
  for (std::size_t i = 32 * rig::kTaxels; i < changed.signals.size(); ++i) changed.signals[i] = 1.5F;
  const Track before = resample(recording, kWideRange), after = resample(changed, kWideRange);
  for (std::size_t i = 0; i < 11 * rig::kTaxels; ++i) ASSERT_EQ(before.samples[i], after.samples[i]);
  EXPECT_NE(before.samples[11 * rig::kTaxels], after.samples[11 * rig::kTaxels]);
}

TEST(Resample, HoldsALostSampleAndCountsIt) {
  Recording recording = make_recording({});
  remove_frame(recording, 40);
  const Track track = resample(recording, kWideRange);
  ASSERT_EQ(track.frames(), 100U);
  EXPECT_EQ(track.held, 1U);
  EXPECT_EQ(track.gaps, 0U);
  EXPECT_EQ(track.samples[40 * rig::kTaxels], track.samples[39 * rig::kTaxels]);
  EXPECT_NEAR(track.position_mm[2 * 40 + 1], 30 + 10.0 * 40 / 300, 1e-4);  // the finger went on moving
  EXPECT_EQ(track.run.back(), 100U);
}

TEST(Resample, NeverFillsAGap) {
  Recording recording = make_recording({});
  for (std::size_t i = 60; i < 100; ++i) recording.time_s[i] += 0.2;
  const Track track = resample(recording, kWideRange);
  EXPECT_EQ(track.frames(), 100U);
  EXPECT_EQ(track.gaps, 1U);
  EXPECT_EQ(track.held, 0U);
  EXPECT_EQ(track.run[59], 60U);
  EXPECT_EQ(track.run[60], 1U);
  EXPECT_EQ(track.run.back(), 40U);
}

TEST(Resample, CallsASilenceOfOverFiftyMillisecondsAGap) {
  const auto gaps_after = [](double silence_s) {
    Recording recording = make_recording({});
    for (std::size_t i = 60; i < 100; ++i) recording.time_s[i] += silence_s - 1 / 300.0;
    return resample(recording, kWideRange).gaps;
  };
  EXPECT_EQ(gaps_after(0.049), 0U);
  EXPECT_EQ(gaps_after(0.051), 1U);
}

TEST(Resample, ToleratesJitter) {
  Recording recording = make_recording({});
  for (std::size_t i = 1; i < 100; ++i) recording.time_s[i] += (i % 2 == 0 ? 0.3 : -0.3) / 300;
  const Track track = resample(recording, kWideRange);
  EXPECT_EQ(track.frames(), 100U);
  EXPECT_EQ(track.held, 0U);
}

TEST(Resample, KeepsUnknownPositionsUnknown) {
  Recording recording = make_recording({});
  recording.position_mm.clear();
  const Track none = resample(recording, kWideRange);
  EXPECT_TRUE(std::isnan(none.position_mm[17]));
  EXPECT_EQ(none.position_mm.size(), 200U);
}

// A frame that comes late fills the sample of its place, and its truth goes with it.
TEST(Resample, ATruthIsThatOfTheNearestFrame) {
  Recording recording = make_recording({});
  for (std::size_t i = 1; i < recording.time_s.size(); ++i) recording.time_s[i] += i % 2 == 0 ? 1e-9 : 1e-3;
  const Track track = resample(recording, kWideRange);
  ASSERT_GT(track.frames(), 50U);
  for (std::size_t j = 0; j < 50; ++j) ASSERT_EQ(track.recorded[j], j);
}

TEST(Resample, OfNothingIsNothing) { EXPECT_EQ(resample(Recording{}, kWideRange).frames(), 0U); }

TEST(Resample, RefusesWhatBreaksARuleOfRecordings) {
  Recording recording = make_recording({});
  recording.signals[40 * rig::kTaxels + 3] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_ERROR(resample(recording, kWideRange), std::runtime_error,
               "recording: signals are not finite at frame 40, taxel 3; record or import the pass again");
  EXPECT_REFUSAL(
      "resample: rate_hz expects at most 64 samples for each recorded frame, got 1e+06 Hz; the model is of "
      "another sensor",
      resample(make_recording({}), {.rate_hz = 1e6}));
}

// One long recording whose signals run evenly from low to high.
Recording even(double low, double high) {
  Recording recording;
  constexpr int kFrames = 64'000;
  for (int i = 0; i < kFrames; ++i) {
    recording.time_s.push_back(i / 1000.0);
    for (int k = 0; k < rig::kTaxels; ++k)
      recording.signals.push_back(static_cast<float>(low + (high - low) * i / (kFrames - 1)));
  }
  return recording;
}

TEST(SignalRange, OfTheRigIsTheRigs) {
  SignalRange range;
  range.add(simulate_pass(Plate::named("3_Bumps"), {}));
  EXPECT_EQ(range.fitted().rest, Scaling{}.rest);
  EXPECT_EQ(range.fitted().span, Scaling{}.span);
  EXPECT_LT(range.clipped(Scaling{}), 0.01);
}

TEST(SignalRange, OfAnotherUnitContradictsWhatIsStated) {
  const SignalScale counts{.unit = "counts", .rest = 0, .span = -1000};
  const auto why = [&](std::vector<float> signals) { return contradiction(signals, counts); };
  EXPECT_EQ(why({0, 0.5F, 1}), "from 0 to 1, the sensor's range is 0 to 1000 counts");
  EXPECT_EQ(why({1300, 900, 2000}), "from 900 to 2000, the sensor's range is 0 to 1000 counts");
  EXPECT_EQ(why({0, 1, 0, 0}), "") << "at rest";
  EXPECT_EQ(why({0.3F, 0.4F}), "") << "at rest, filtered";
  EXPECT_EQ(why({-200, 900, 1200}), "");
  EXPECT_EQ(contradiction(std::vector<float>{0, 0.5F, 1}, {.unit = "1", .rest = 0, .span = -1}), "");
  EXPECT_EQ(contradiction({}, counts), "");
}

// A folder is refused that says counts and holds shares, unless the user gives the range.
TEST(SignalRange, OfAFolderIsWhatItStates) {
  const TemporaryFolder folder;
  Recording recording = even(0, 1);
  recording.signal_scale = {.unit = "counts", .rest = 40, .span = -860};
  recording.plate = "pairs", recording.source = "imported", recording.trial = recording.pass = 1;
  write_recording(folder / "a.safetensors", recording);
  EXPECT_ERROR((void)SignalRange::of_folder(folder.path(), {}), FileError,
               "a.safetensors: has signals from 0 to 1, the sensor's range is 40 to 900 counts");
  EXPECT_EQ(SignalRange::of_folder(folder.path(), {}, {}, true).clipped({.rest = 1, .span = 1}), 0);
}

TEST(SignalRange, OfAnotherSensorHoldsItsSignals) {
  SignalRange range;
  range.add(even(68, 102));
  EXPECT_EQ(range.clipped(Scaling{}), 1);
  const Scaling fitted = range.fitted();
  EXPECT_NEAR(fitted.rest, 101.8, 0.1);
  EXPECT_NEAR(fitted.span, 37, 0.3);
  EXPECT_EQ(range.clipped(fitted), 0);
  EXPECT_EQ(range.text(), "68.136 to 101.797");
}

// As steps and presses are recorded: the first frame of each shows nothing.
TEST(SignalRange, SeesShortRecordingsWhole) {
  Recording press;
  press.signal_scale = {.unit = "kPa", .rest = 0, .span = -1};
  for (int i = 0; i < 40; ++i) {
    press.time_s.push_back(i / 50.0);
    press.signals.insert(press.signals.end(), rig::kTaxels,
                         static_cast<float>(0.5 * std::sin(3.14 * i / 40)));
  }
  SignalRange range;
  for (int i = 0; i < 100; ++i) range.add(press);
  EXPECT_EQ(range.fitted().span, -1);
  EXPECT_GE(range.values().size(), 100U * 16 * rig::kTaxels);
}

TEST(SignalRange, CountsBothSides) {
  SignalRange range;
  range.add(even(0, 1));
  EXPECT_NEAR(range.clipped({.rest = 0.8, .span = 0.4}), 0.4 + 0.1, 0.01);
}

TEST(SignalRange, OfNothingIsTheRigs) { EXPECT_EQ(SignalRange().fitted().span, Scaling{}.span); }

}  // namespace supertac::resample_test
