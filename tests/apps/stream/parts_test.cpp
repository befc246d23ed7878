// The parts of a stream by themselves: lines for other programs, recordings, an order from presses,
// latencies.
#include "apps/stream/stream.h"

#include <fcntl.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <nlohmann/json.hpp>

#include "apps/stream/picture_log.h"
#include "apps/stream/pressed_order.h"
#include "apps/stream/views/for_programs.h"
#include "io/files/json.h"
#include "tests/apps/common/expect.h"
#include "tests/support/draws.h"
#include "tests/support/test.h"

namespace supertac::parts_test {

const std::vector<float> kVolts(16, 2.4F), kPicture(256, 0.5F), kHalf(256, 0.25F);

const std::string kAbout = about_lines({}, "V", {});

LiveFrame seen(std::uint64_t number) {
  return {.number = number,
          .time_s = static_cast<double>(number) / 1008,
          .wall_s = NAN,
          .signals = kVolts,
          .picture = kPicture,
          .half_widths = {},
          .distance = {}};
}

TEST(PictureLine, HoldsWhatIsKnownAndNothingElse) {
  LiveFrame one = seen(3);
  const std::string about = about_lines({.rows = 2, .columns = 8, .pitch_mm = 5}, "N", {8, 32, 1.25});
  const std::string line = picture_line(one, {2.5, 3}, {.unit = "N"}, false, about);
  EXPECT_TRUE(line.ends_with("}\n"));
  auto json = parse_json_limited(line);
  EXPECT_NEAR(json["timestamp"].get<double>(), 3.0 / 1008, 1e-6);
  EXPECT_EQ(json["signals"].get<std::vector<float>>(), kVolts);
  json.erase("timestamp"), json.erase("signals");
  const nlohmann::ordered_json expected = {{"number", 3},        {"height", 8},    {"width", 32},
                                           {"pixel_mm", 1.25},   {"rows", 2},      {"columns", 8},
                                           {"channels", 1},      {"pitch_mm", 5},  {"unit", "N"},
                                           {"total_force", 2.5}, {"saturated", 3}, {"picture", kPicture}};
  EXPECT_EQ(nlohmann::json(json), nlohmann::json(expected));
  one.half_widths = kHalf, one.distance = 1.5, one.wall_s = 1.7e9;
  json = parse_json_limited(picture_line(one, {}, {}, true, about));
  EXPECT_EQ(json["wall_s"], 1.7e9);
  EXPECT_EQ(json["half_width"], 0.25);
  EXPECT_EQ(json["distance"], 1.5);
  EXPECT_EQ(json["unlike_training"], 1);
  const std::vector<float> strange(16, std::nanf(""));
  one.signals = strange;
  EXPECT_TRUE(parse_json_limited(picture_line(one, {}, {}, true, about))["volts"][0].is_null());
}

class Pipe : public testing::Test {
 protected:
  Pipe() {
    signal(SIGPIPE, SIG_IGN);
    EXPECT_EQ(pipe2(ends_, O_CLOEXEC), 0);
  }
  ~Pipe() override {
    for (const int end : ends_)
      if (end >= 0) close(end);
  }
  int ends_[2] = {-1, -1};
};

TEST_F(Pipe, WhoDoesNotReadLosesLinesAndHoldsUpNobody) {
  const auto begin = std::chrono::steady_clock::now();
  {
    PipeOutput output(ends_[1], false);
    for (std::uint64_t i = 0; i < 5000; ++i) output.send(picture_line(seen(i), {}, {}, false, kAbout));
    EXPECT_GT(output.lost(), 500U);
  }
  EXPECT_LT(std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count(), 200);
}

TEST_F(Pipe, APatientOneLosesNothing) {
  std::thread reader;
  std::string all;
  {
    PipeOutput output(ends_[1], true);
    reader = std::thread([&] {
      char buffer[4096];
      for (ssize_t count; (count = read(ends_[0], buffer, sizeof buffer)) > 0;)
        all.append(buffer, static_cast<std::size_t>(count));
    });
    for (int i = 0; i < 20'000; ++i) output.send(std::to_string(i) + "\n");
    EXPECT_EQ(output.lost(), 0U);
  }
  close(std::exchange(ends_[1], -1));
  reader.join();
  std::string expected;
  for (int i = 0; i < 20'000; ++i) expected += std::to_string(i) + "\n";
  EXPECT_EQ(all, expected);
}

// Else a steady reader would keep the clock and the signals from being looked at until all is written.
TEST_F(Pipe, WhoWaitsWritesOnePiece) {
  PipeOutput output(ends_[1], false);
  const std::string line(4096, '-');
  for (int i = 0; i < 40; ++i) output.send(line);
  int ready = 0;
  ASSERT_EQ(ioctl(ends_[0], FIONREAD, &ready), 0);
  ASSERT_GT(ready, 0);
  std::string taken(static_cast<std::size_t>(ready), ' ');
  ASSERT_EQ(read(ends_[0], taken.data(), taken.size()), ready);
  output.write_waiting(1000);
  ASSERT_EQ(ioctl(ends_[0], FIONREAD, &ready), 0);
  EXPECT_EQ(ready, 4096);
}

TEST_F(Pipe, AReaderThatLeavesIsNoticed) {
  PipeOutput output(ends_[1], false);
  close(std::exchange(ends_[0], -1));
  const auto send_on = [&] {
    for (int i = 0; i < 240'000; ++i, usleep(500)) output.send("line\n");
  };
  EXPECT_THROW(send_on(), std::runtime_error);
}

namespace fs = std::filesystem;

class RecorderTest : public testing::Test {
 protected:
  RecorderTest() : before_(fs::current_path()) { fs::current_path(folder_.path()); }
  ~RecorderTest() override { fs::current_path(before_); }

  TemporaryFolder folder_;
  fs::path before_;
};

const PictureFormat kFormat{.signals = 2, .image = {2, 2, 1}, .half_widths = true, .distance = true};

LiveFrame seen_at(double time_s) {
  static const std::vector<float> volts = {1, 2}, picture = {3, 4, 5, 6}, half = {7, 8, 9, 10};
  return {.time_s = time_s, .signals = volts, .picture = picture, .half_widths = half, .distance = 11.0};
}

TEST_F(RecorderTest, KeepsWhatCameBetweenStartAndStop) {
  std::string name;
  {
    Recorder recorder(kFormat, {{"kind", "pictures"}});
    recorder.add(seen_at(0));
    EXPECT_EQ(recorder.stop(), "nothing is being recorded");
    EXPECT_TRUE(recorder.start().starts_with("recording recording_2"));
    name = recorder.status().recording;
    recorder.add(seen_at(1));
    recorder.add(seen_at(1.5));
    EXPECT_EQ(recorder.status().seconds, 0.5);
    EXPECT_FALSE(fs::exists(name));  // not before it is complete
    EXPECT_EQ(recorder.stop(), "writing " + name);
    recorder.add(seen_at(2));
    EXPECT_EQ(recorder.stop(), "nothing is being recorded");
    EXPECT_EQ(recorder.finish(), "recorded " + name);
  }
  const SafetensorsFile file = SafetensorsFile::read(name);
  EXPECT_EQ(file.f64("time_s"), (std::vector<double>{1, 1.5}));
  EXPECT_EQ(file.f32("volts"), (std::vector<float>{1, 2, 1, 2}));
  EXPECT_EQ(file.f32("half_widths"), (std::vector<float>{7, 8, 9, 10, 7, 8, 9, 10}));
  EXPECT_EQ(file.f32("distances"), (std::vector<float>{11, 11}));
}

TEST_F(RecorderTest, AnEndCompletesTheFileIfAFrameCame) {
  for (const bool any : {true, false}) {
    std::string name, said;
    {
      Recorder recorder(kFormat, {});
      recorder.start();
      name = recorder.status().recording;
      if (any) {
        recorder.add(seen_at(1));
      } else {
        said = recorder.finish();
      }
    }
    EXPECT_EQ(said, any ? "" : "no frame came: nothing was recorded");
    EXPECT_EQ(fs::exists(name), any);
    fs::remove(name);
  }
}

TEST_F(RecorderTest, AFileThatAppearedMeanwhileStays) {
  Recorder recorder(kFormat, {});
  recorder.start();
  std::string name = recorder.status().recording;
  recorder.add(seen_at(1));
  write_file(name, "mine");
  EXPECT_TRUE(contains(recorder.finish(), "-2.safetensors"));
  EXPECT_EQ(read_text_file(name, 9), "mine");
  name.replace(name.find(".safe"), 0, "-2");
  EXPECT_EQ(SafetensorsFile::read(name).f64("time_s").size(), 1U);
}

TEST_F(RecorderTest, WhatIsWrittenHoldsNoFileOpen) {
  const auto open_files = [] { return std::distance(fs::directory_iterator("/proc/self/fd"), {}); };
  Recorder recorder(kFormat, {});
  const auto before = open_files();
  for (int i = 0; i < 3; ++i) recorder.start(), recorder.add(seen_at(i)), recorder.stop();
  for (int i = 0; i < 10'000 && open_files() > before; ++i) usleep(1000);
  EXPECT_EQ(open_files(), before);
}

TEST_F(RecorderTest, AFolderThatIsGoneIsSaid) {
  Recorder recorder(kFormat, {});
  fs::remove_all(fs::current_path());
  EXPECT_FALSE(recorder.start().starts_with("recording"));
  EXPECT_EQ(recorder.status().recording, "");
}

TEST(PressedOrder, IsTheWiringWhateverIsFeltBesides) {
  const TemporaryFolder folder;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    Draws draw(seed, 57);
    Sensor draft{.array = {.rows = 3, .columns = 5, .channels = 1}, .frame = {.kind = FrameKind::text}};
    const auto shuffled = [&] {
      std::vector<int> order(15);
      std::iota(order.begin(), order.end(), 0);
      for (std::size_t k = 14; k > 0; --k) std::swap(order[k], order[draw.below(k + 1)]);
      return order;
    };
    // As the draft has it, and as it is: at its place 4 nothing answers.
    if (seed % 2 == 0) draft.order = shuffled();
    const std::vector<int> wiring = shuffled();
    for (int k = 0; k < 15; ++k) draft.rest.push_back(static_cast<float>(2 + 0.01 * k));
    const std::string path = folder / "sensor.json";
    write_sensor(path, draft);
    PressedOrder order(draft, {}, path);
    (void)order.start();
    std::vector<double> felt(15);
    const auto press = [&](int place, double strength) {
      for (int n = 0; n < 60; ++n) {
        for (int other = 0; other < 15; ++other) {
          const double away = std::hypot(place / 5 - other / 5, place % 5 - other % 5);
          const double now = n < 25 && away < 2 ? strength * std::exp(-0.5 * away * away) : 0;
          felt[static_cast<std::size_t>(other)] += 0.25 * (now - felt[static_cast<std::size_t>(other)]);
        }
        std::vector<double> loads(15);
        for (std::size_t t = 0; t < 15; ++t) {
          const int at = draft.order.empty() ? static_cast<int>(t) : draft.order[t];
          const auto of = static_cast<std::size_t>(std::ranges::find(wiring, at) - wiring.begin());
          loads[t] = std::abs(felt[of] + 0.002 * draw.normal());
        }
        order.push(loads);
      }
    };
    for (int place = 0; place < 15; ++place) {
      ASSERT_EQ(order.status().asked, place) << seed << order.status().says;
      if (place == 7) press(2, 0.2);
      ASSERT_EQ(order.status().asked, place);
      if (place == 4)
        (void)order.skip();
      else
        press(place, 0.05 + 0.2 * draw());
    }
    ASSERT_FALSE(order.status().asked);
    const Sensor found = read_sensor(path);
    EXPECT_EQ(found.order, wiring) << seed;
    EXPECT_EQ(found.dead, std::vector<int>{4});
    for (std::size_t k = 0; k < 15; ++k) {
      const int was = draft.order.empty()
                          ? wiring[k]
                          : static_cast<int>(std::ranges::find(draft.order, wiring[k]) - draft.order.begin());
      EXPECT_FLOAT_EQ(found.rest[k], static_cast<float>(2 + 0.01 * was)) << seed;
    }
  }
}

TEST(PressedOrder, WritesNothingOverAFileThatHasChanged) {
  const TemporaryFolder folder;
  Sensor draft{.array = {.rows = 1, .columns = 1}, .frame = {.kind = FrameKind::text}};
  PressedOrder order(draft, {}, folder / "sensor.json");
  draft.name = "edited meanwhile";
  write_sensor(folder / "sensor.json", draft);
  (void)order.start();
  for (const double load : {0.0, 0.1, 0.0}) order.push({{load}});
  EXPECT_TRUE(contains(order.status().says, "is not what the probe wrote any more"));
  EXPECT_EQ(read_sensor(folder / "sensor.json").name, "edited meanwhile");
}

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

}  // namespace supertac::parts_test
