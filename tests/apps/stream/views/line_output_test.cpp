// Pictures for other programs: each line is parsed as its reader would, and who does not read costs nothing.
#include "apps/stream/views/line_output.h"

#include <fcntl.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <fstream>

#include "io/files/json.h"
#include "tests/support/test.h"

namespace supertac::line_output_test {

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
  EXPECT_EQ(json["picture"].get<std::vector<float>>(), kPicture);
  EXPECT_EQ(json["height"], 8);
  EXPECT_EQ(json["width"], 32);
  EXPECT_EQ(json["pixel_mm"], 1.25);
  EXPECT_EQ(json["rows"], 2);
  EXPECT_EQ(json["columns"], 8);
  EXPECT_EQ(json["channels"], 1);
  EXPECT_EQ(json["pitch_mm"], 5);
  EXPECT_EQ(json["unit"], "N");
  EXPECT_EQ(json["total_force"], 2.5);
  EXPECT_EQ(json["saturated"], 3);
  EXPECT_EQ(json.size(), 14U);
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

TEST_F(Pipe, AReaderThatLeavesIsNoticed) {
  PipeOutput output(ends_[1], false);
  close(std::exchange(ends_[0], -1));
  const auto send_on = [&] {
    for (int i = 0; i < 240'000; ++i, usleep(500)) output.send("line\n");
  };
  EXPECT_THROW(send_on(), std::runtime_error);
}

}  // namespace supertac::line_output_test
