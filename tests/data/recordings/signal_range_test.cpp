#include "data/recordings/resample.h"

#include "data/simulation/simulator.h"
#include "tests/support/test.h"

namespace supertac::signal_range_test {

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

TEST(SignalRange, LeavesOutWhatIsNoNumber) {
  Recording recording = even(68, 102);
  for (std::size_t i = 0; i < recording.signals.size(); i += 3) recording.signals[i] = NAN;
  SignalRange range;
  range.add(recording);
  EXPECT_NEAR(range.fitted().span, 37, 0.3);
  EXPECT_EQ(SignalRange().fitted().span, Scaling{}.span);
}

}  // namespace supertac::signal_range_test
