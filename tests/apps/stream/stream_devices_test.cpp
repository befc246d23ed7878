// supertac-stream beside devices and hosts that pause, hand on late, vanish or are the wrong ones.
#include <unistd.h>

#include <csignal>

#include "apps/stream/picture_log.h"
#include "data/recordings/recording.h"
#include "tests/apps/stream/streaming.h"
#include "tests/hardware/fake_sensor.h"
#include "tests/hardware/numbered_board.h"
#include "tests/support/test.h"

namespace supertac::stream_devices_test {

namespace fs = std::filesystem;

TEST_F(Streaming, UnpluggingIsOneClearLineAndKeepsWhatWasSeen) {
  FaultyPtyRig& rig = plug_in();
  RunningProcess running = start("--board " + board() + " --out out --capture capture");
  wait_for_file(path("capture"), kTwoSeconds);
  rig.unplug_board();
  const ProcessResult result = running.wait();
  expect_failure(result, 1, "the device is gone");
  EXPECT_GT(kept("out").f64("time_s").size(), 0U);
  EXPECT_EQ(stream("--replay capture").code, 0);
}

// A terminal holds 25 ms of frames; what the board sends beyond while nobody reads is lost.
TEST_F(Streaming, AProgramThatWasStoppedStartsANewWindow) {
  FaultyPtyRig& rig = plug_in();
  RunningProcess running = start("--board " + board() + " --json json --capture capture");
  wait_for_file(path("capture"), kTwoSeconds);  // it draws by now
  running.send(SIGSTOP);
  const auto sent_s = [&] {
    double now = 0;
    rig.with_world([&](RigWorld& world) { now = world.now(); });
    return now;
  };
  for (const double stopped = sent_s(); sent_s() < stopped + 0.4;) usleep(1000);
  running.send(SIGCONT);
  wait_for_growth(path("capture"), kTwoSeconds / 2);
  running.send(SIGINT);
  ASSERT_EQ(running.wait().code, 130);
  EXPECT_GE(json("json").at("gaps"), 1);
  EXPECT_GE(json("json").at("suspect"), 1);
}

TEST_F(Streaming, ChunksOfAnAdapterCostLatencyAndNoPicture) {
  RigSettings settings = touching_rig();
  settings.chunk_s = 0.1, settings.memory = 65536;
  plug_in(settings);
  ASSERT_EQ(stream("--board " + board() + " --seconds 5 --json json").code, 0);
  const auto result = json("json");
  EXPECT_EQ(result.at("gaps"), 0);
  // All but those of the first window, and of the burst that had waited for somebody to listen.
  const double made = result.at("pictures").get<double>() + result.at("dropped").get<double>();
  EXPECT_GT(made, result.at("frames").get<double>() - 32 / 300.0 / rig::kFramePeriodS - 450);
  EXPECT_GT(result.at("pictures"), 0);
}

// Stopped as by Ctrl-Z, or on a machine that swaps: what is recorded is dated right, or left out and counted.
// SUPERTAC_MUTATIONS says how often.
TEST_F(Streaming, StoppedForAWhileItRecordsWhatItCanDate) {
  for (int seed = 1; seed <= mutations(2); ++seed) {
    const RandomStream draw(static_cast<std::uint64_t>(seed), 3);
    RigSettings settings = touching_rig();
    NumberedBoard numbers(settings);
    FaultyPtyRig& rig = plug_in(settings);
    rig.with_world([&](RigWorld& world) { numbers.watch(world.board()); });
    RunningProcess running("supertac-stream",
                           {"--board", board(), "--record", path("kept"), "--capture", path("capture"),
                            "--json", path("json"), "--quiet", "--force"});
    wait_for_file(path("capture"), kTwoSeconds);
    running.send(SIGSTOP);
    usleep(static_cast<useconds_t>(1e6 * (0.05 + 1.5 * draw.uniform(1))));
    running.send(SIGCONT);
    wait_for_growth(path("capture"), kTwoSeconds);
    running.send(SIGINT);
    const ProcessResult ended = running.wait();
    rig_.reset();  // whose thread counts frames until here
    ASSERT_EQ(ended.code, 130) << ended.error;
    const Recording recording = read_recording(json("json").at("recording"));
    std::vector<double> off_s;  // from the board's own time, as far as the clocks' zeros are apart
    for (std::size_t i = 0; i < recording.frames(); ++i)
      for (const std::uint64_t n : numbers.numbers_in(recording.signals, i))
        off_s.push_back(recording.time_s[i] - static_cast<double>(n) * rig::kFramePeriodS);
    ASSERT_GT(off_s.size(), 1000U);
    const auto [least, most] = std::ranges::minmax(off_s);
    EXPECT_LT(most - least, 2 * PictureLog::kTrustedS) << "seed " << seed;
    const std::string left_out = std::to_string(json("json").at("left_out").get<int>());
    EXPECT_EQ(value_or(recording.metadata, "left_out_frames", "0"), left_out);
    EXPECT_EQ(ended.out.find("frames left out, their time being uncertain") == std::string::npos,
              left_out == "0")
        << ended.out;
    fs::remove(path("capture"));
  }
}

TEST_F(Streaming, ASignalEndsItCleanly) {
  plug_in();
  for (const int signal : {SIGINT, SIGTERM}) {
    RunningProcess running = start("--board " + board() + " --out out --json json --capture capture --force");
    wait_for_file(path("capture"), kTwoSeconds);
    running.send(signal);
    const ProcessResult result = running.wait();
    EXPECT_EQ(result.code, 128 + signal);
    EXPECT_EQ(result.error, "");
    EXPECT_EQ(kept("out").f64("time_s").size(), json("json").at("pictures"));
    fs::remove(path("capture"));
  }
}

}  // namespace supertac::stream_devices_test
