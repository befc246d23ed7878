// What a stream shows of itself: the picture on a terminal, and how late it is.
#include <gtest/gtest.h>

#include "apps/stream/latency_histogram.h"
#include "apps/stream/raw_array.h"
#include "apps/stream/views/terminal_view.h"
#include "tests/io/temporary_folder.h"

namespace supertac {
namespace {

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
  recording.volts.assign(16, 100), recording.plate = "unknown", recording.trial = recording.pass = 1;
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

TEST(TerminalView, YGrowsUpwardsAndBothPicturesHaveTheSameSize) {
  LiveState state;
  state.taxels.assign(16, 0.0F);
  state.taxels[12] = 1;  // largest y, smallest x: top left
  state.picture.assign(256, 0.0F);
  state.picture[15] = 1;  // smallest y, largest x: bottom right
  state.top = 0.25, state.unit = "V";
  const std::string text = render(state, false);
  std::vector<std::string> lines;
  for (std::size_t at = 0; at < text.size(); at = text.find('\n', at) + 1)
    lines.push_back(text.substr(at, text.find('\n', at) - at));
  ASSERT_EQ(lines.size(), 19U);
  EXPECT_EQ(lines[0], "felt, 12 x 12 mm" + std::string(19, ' ') + "drawn, 12 x 12 mm");
  for (std::size_t i = 1; i < 17; ++i) EXPECT_EQ(lines[i].size(), 67U);
  EXPECT_EQ(lines[1], "@@@@@@@@" + std::string(59, ' '));
  EXPECT_EQ(lines[4], lines[1]);
  EXPECT_EQ(lines[5], std::string(67, ' '));
  EXPECT_EQ(lines[16], std::string(65, ' ') + "@@");
  EXPECT_EQ(lines[17], "0  .:-=+*#%@ 1  felt: 0.2500 V from rest; drawn: the highest");
  EXPECT_EQ(lines[18], "0 frames/s  latency 0.00 ms (p99 0.00)  lost 0  dropped 0");
}

TEST(TerminalView, SaysWhereTheFingerIsAndThatSignalsAreStrange) {
  LiveState state;
  state.x_mm = 5.5F, state.y_mm = 62.25F;
  EXPECT_TRUE(status_line(state).ends_with("dropped 0  at x 5.5 y 62.2 mm\n")) << status_line(state);
  state.unlike_training = true;
  EXPECT_EQ(status_line(state, 20), "UNLIKE TRAINING  0 f\n");
}

// Both pictures, one, or a line that says why there is none: nothing wider than the window, never wordless.
TEST(TerminalView, FallsBackWhereTheWindowIsSmall) {
  LiveState state;
  state.taxels.assign(16, 0.5F), state.picture.assign(256, 0.5F);
  for (const auto& [size, count, first] : {std::tuple(TerminalSize{67, 20}, 19, "felt"),
                                           {TerminalSize{66, 20}, 19, "drawn"},
                                           {TerminalSize{32, 20}, 19, "drawn"},
                                           {TerminalSize{31, 20}, 1, "0 frames"},
                                           {TerminalSize{80, 19}, 2, "too small"},
                                           {TerminalSize{5, 1}, 1, "0 fra"}}) {
    const std::string text = render(state, false, size);
    EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), count) << size.columns;
    EXPECT_TRUE(text.starts_with(first)) << text;
    for (std::size_t at = 0, end; (end = text.find('\n', at)) != std::string::npos; at = end + 1)
      EXPECT_LE(static_cast<int>(end - at), size.columns) << text.substr(at, end - at);
  }
}

TEST(TerminalView, ColoursAreWrittenWhereTheyChange) {
  LiveState state;
  const std::string blank = render(state, true);
  // Black on black, twice a line, and back.
  EXPECT_EQ(blank.find("\x1b[38;5;16m\x1b[48;5;16m\u2580\u2580"), blank.find('\n') + 1);
  state.scale = 2;
  state.picture.assign(64, 2.0F);  // brighter than white is white, and NaN is black
  state.picture[0] = std::nanf("");
  EXPECT_NE(render(state, true).find("\x1b[38;5;231m"), std::string::npos);
  EXPECT_EQ(std::count(blank.begin(), blank.end(), '\n'), 19);
}

TEST(TerminalView, KeepsTheShapeOfAnyArray) {
  LiveState state;
  state.array = {.rows = 2, .columns = 8};
  state.scale = 8;
  state.taxels.assign(16, 0.0F);
  state.taxels[8] = 1;
  state.picture.assign(16 * 64, 0.0F);  // finer than the terminal
  const std::string text = render(state, false);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'),
            7);  // 8 of 32 pixels high, headings, scale and figures
  EXPECT_EQ(text.substr(text.find('\n') + 1, 8), "@@@@    ");
}

}  // namespace
}  // namespace supertac
