// What a stream shows of itself on a terminal, and how late it is.

#include "apps/stream/stream.h"
#include "tests/support/test.h"

namespace supertac::live_view_test {

TEST(LatencyHistogram, QuantilesAreRightToAClass) {
  LatencyHistogram histogram;
  EXPECT_EQ(histogram.quantile(0.5), 0);
  for (int i = 1; i <= 1000; ++i) histogram.add(1e-6 * i);
  EXPECT_EQ(histogram.count(), 1000U);
  EXPECT_NEAR(histogram.quantile(0.5), 500e-6, 10e-6);
  EXPECT_NEAR(histogram.quantile(0.99), 990e-6, 16e-6);
  EXPECT_EQ(histogram.quantile(1), 1e-3);
  histogram.add(1e7);  // beyond the last class
  EXPECT_EQ(histogram.max(), 1e7);
  EXPECT_EQ(histogram.quantile(1), histogram.max());
}

// Also against the direction that its file names, which may be wrong; noise is none.
TEST(RawArray, SaysWhichSignalIsFarthestFromItsRest) {
  const TemporaryFolder folder;
  Recording recording;
  recording.time_s = {0, 0.01}, recording.array = {.rows = 2, .columns = 2, .channels = 2};
  recording.signal_scale = {.unit = "counts", .rest = 100, .span = -400};
  recording.signals.assign(16, 100), recording.plate = "unknown", recording.trial = recording.pass = 1;
  write_recording(folder / "r.safetensors", recording);
  const auto source = open_recording(folder / "r.safetensors");
  RawArray raw(*source);
  EXPECT_FALSE(raw.most_changed());
  std::vector<float> signals(8, 110);
  for (int n = 0; n < 40; ++n) raw.push(signals);
  signals[1] = 120, signals[2] = std::nanf("");
  raw.push(signals);
  EXPECT_FALSE(raw.most_changed());
  signals[1] = 150, signals[5] = 30;
  raw.push(signals);
  const auto most = raw.most_changed();
  ASSERT_TRUE(most);
  EXPECT_EQ(most->taxel, 2);
  EXPECT_EQ(most->channel, 1);
  EXPECT_NEAR(most->rest, 110, 1e-9);
  EXPECT_EQ(most->now, 30);
}

TEST(StatusLine, SaysWhereTheFingerIsAndThatSignalsAreStrange) {
  LiveState state;
  state.x_mm = 5.5F, state.y_mm = 62.25F;
  EXPECT_TRUE(status_line(state).ends_with("dropped 0  at x 5.5 y 62.2 mm")) << status_line(state);
  state.unlike_training = true;
  EXPECT_TRUE(status_line(state).starts_with("UNLIKE TRAINING  0 f"));
}

}  // namespace supertac::live_view_test
