// What supertac-stream draws of replays, recordings and a board, and what becomes of files and options.
#include "tests/apps/stream/streaming.h"

#include "apps/stream/stream.h"
#include "data/recordings/recording.h"
#include "data/simulation/simulator.h"
#include "data/windows/windows.h"
#include "hardware/ports/serial_port.h"
#include "tests/support/tensor_file.h"
#include "tests/support/test.h"

namespace supertac::stream_test {

namespace fs = std::filesystem;

TEST_F(Streaming, AReplayGivesThePicturesThatLiveHad) {
  plug_in();
  const ProcessResult live =
      stream("--board " + board() + " --seconds 1.5 --out live --capture capture --json json");
  ASSERT_EQ(live.code, 0) << live.error;
  const ProcessResult replayed = stream("--replay capture --seconds 1.5 --out replay");
  ASSERT_EQ(replayed.code, 0) << replayed.error;
  const auto result = json("json");
  const SafetensorsFile first = kept("live"), again = kept("replay");
  const std::size_t pictures = first.f64("time_s").size();
  EXPECT_EQ(result.at("pictures"), pictures);
  ASSERT_GT(pictures, 0U);
  const std::vector<double> times = again.f64("time_s");
  // Every picture of the replay, but those that a busy machine was too late for.
  EXPECT_LE(pictures, times.size());
  EXPECT_GE(pictures + result.at("dropped").get<std::size_t>(), times.size());
  const std::vector<float> pixels = first.f32("pictures"), pixels_again = again.f32("pictures");
  std::size_t at = 0;
  for (std::size_t i = 0; i < pictures; ++i) {
    while (at < times.size() && times[at] != first.f64("time_s")[i]) ++at;
    ASSERT_LT(at, times.size()) << "picture " << i << " has no twin in the replay";
    ASSERT_TRUE(std::equal(&pixels[i * 64], &pixels[i * 64] + 64, &pixels_again[at * 64])) << i;
  }
}

TEST_F(Streaming, TheMapOfARecordingHasTheBitsOfTheWindowsMap) {
  constexpr double kDelayS = 0.02;  // each picture is of the place where the finger was then
  const Recording recording = record(40);
  write_model(model(), kTimesteps, SimulatorSettings().filter_s, kDelayS);
  ASSERT_EQ(stream("--recording recording --out out --map map.safetensors").code, 0);
  const SafetensorsFile out = kept("out"), map = kept("map.safetensors");
  const std::vector<float> pictures = out.f32("pictures");
  const std::vector<double> times = out.f64("time_s");
  SurfaceMap expected(load_model(model()).windows().array->picture(2));
  for (std::size_t i = 0, frame = 0; i < times.size(); ++i) {
    while (recording.time_s[frame + 1] - recording.time_s[0] < times[i] - kDelayS + 1e-9) ++frame;
    if (!recording.lift_mm.empty() && recording.lift_mm[frame] > kLiftedMm) continue;
    expected.add(recording.position_mm[2 * frame], recording.position_mm[2 * frame + 1],
                 std::span(pictures).subspan(64 * i, 64), {});
  }
  const MapCells cells = expected.cells(expected.felt());
  const std::vector<float> values = map.f32("surface.values");
  ASSERT_EQ(values.size(), cells.values.size());
  EXPECT_GT(cells.region.height, 15);
  for (std::size_t i = 0; i < values.size(); ++i)
    ASSERT_EQ(std::bit_cast<std::uint32_t>(values[i]), std::bit_cast<std::uint32_t>(cells.values[i])) << i;
  ASSERT_EQ(stream("--recording recording --map stated.safetensors --elements bumps").code, 0);
  const std::vector<float> stated = kept("stated.safetensors").f32("surface.values");
  ASSERT_EQ(stated.size(), values.size());
  for (std::size_t i = 0; i < values.size(); ++i)
    ASSERT_TRUE(std::isnan(values[i]) ? std::isnan(stated[i]) : stated[i] >= 0 && stated[i] <= 1) << i;
  plug_in();
  expect_failure(stream("--board " + board() + " --seconds 0.5 --map map.png"), 1,
                 "no picture's place is known");
}

// The same without a process.
TEST_F(Streaming, EndsWhenItsTimeIsOverAndCounts) {
  const Recording recording = record(40);
  const std::vector<ModelFile> models = load_models(std::vector{model()});
  const auto source = open_recording(path("recording"));
  Stream stream({.seconds = 0.5, .out = path("out")}, models, *source);
  stream.run();
  stream.finish();
  const auto within = [&](double t) { return t - recording.time_s[0] < 0.5; };
  const auto frames = std::count_if(recording.time_s.begin(), recording.time_s.end(), within);
  EXPECT_EQ(stream.result()["frames"], frames);
  EXPECT_EQ(stream.result()["dropped"], 0);
  EXPECT_GT(stream.pictures(), 100u);
  EXPECT_EQ(kept("out").f64("time_s").size(), stream.pictures());
  EXPECT_TRUE(stream.summary().starts_with(std::to_string(frames) + " frames in 0.5 s, " +
                                           std::to_string(stream.pictures()) + " pictures, latency median "))
      << stream.summary();
}

// A board whose frames were long under way.
class LateBoard : public SensorSource {
 public:
  LateBoard() : SensorSource(1.0 / 300, 0, true) {}
  std::optional<SensorFrame> next(double) override {
    if (ended()) return std::nullopt;
    return SensorFrame{frame_++ / 300.0, volts_, monotonic_seconds() - (frame_ > 50 ? 1 : 0)};
  }
  bool ended() const override { return frame_ == 100; }
  ReaderCounters counters() override { return {}; }
  void finish() override {}

 private:
  std::vector<float> volts_ = std::vector<float>(rig::kTaxels, 2.3F);
  int frame_ = 0;
};

TEST_F(Streaming, APictureThatWouldBeLateIsNotMade) {
  const std::vector<ModelFile> models = load_models(std::vector{model()});
  LateBoard board;
  Stream stream({}, models, board);
  stream.run();
  EXPECT_EQ(stream.result()["frames"], 100);
  EXPECT_GE(stream.result()["dropped"], 50);
  EXPECT_LT(stream.pictures(), 50u);
}

TEST_F(Streaming, TakesModelsOfAnyWindowAndRefusesWhatWasFilteredOtherwise) {
  const Recording recording = record(40);
  for (const Dim timesteps : {64, 256}) {
    write_model(model(), timesteps, SimulatorSettings().filter_s);
    ASSERT_EQ(stream("--recording recording --json json --force").code, 0);
    EXPECT_NEAR(json("json").at("pictures"), recording.frames() - timesteps, 5) << timesteps;
  }
  write_model(model(), kTimesteps, 0);
  expect_failure(stream("--recording recording"), 1, "moving average of 0.0992 s, the model was");
  write_model(model(), kTimesteps, std::nullopt);
  EXPECT_EQ(stream("--recording recording").code, 0);
  write_recording(path("mat"), simulate_pass(Plate::named("bumps12"), {},
                                             {.array = {.rows = 2, .columns = 6, .pitch_mm = 2}}));
  expect_failure(stream("--recording mat"), 1,
                 "signals are those of 2x6 taxels at 2 mm, the model was trained on 4x4 taxels at 3 mm");
}

TEST_F(Streaming, WrongUsageIsCode2AndWrongFilesAreNamed) {
  struct Wrong {
    std::string options;
    int code;
    std::string said;
  };
  for (const auto& [options, code, said] :
       std::vector<Wrong>{{"", 2, "expected one of --sensor FILE, --board PORT"},
                          {"--board a --replay b", 2, "found 2"},
                          {"--replay a --capture b", 2, "--capture: only with --board"},
                          {"--recording a --seconds 0", 2, "--seconds"},
                          {"--recording recording --elements bumps", 2, "only with --map"},
                          {"--recording recording --map map.npy", 2, "written as .png, .safetensors"},
                          {"--recording r --map m.png --elements 3_Bumps", 2, "one element in its middle"},
                          {"--board a", 1, "port a: no such port"},
                          {"--recording none", 1, "none"},
                          {"--replay none", 1, "none"},
                          {"--replay model", 1, "expected a SuperTac journal"},
                          {"--replay /dev/zero", 1, "is not a regular file"},
                          {"--recording model", 1, "model"}})
    expect_failure(stream(options), code, said);
  fs::remove(model());
  expect_failure(stream("--board " + board()), 1, "model: cannot open the file");
}

TEST_F(Streaming, TooShortASignalSaysHowMuchIsNeeded) {
  Recording recording = simulate_pass(Plate::named("bumps12"), {.to_mm = 32});
  recording.metadata.erase("filter_s");
  recording.time_s.resize(20), recording.signals.resize(20 * rig::kTaxels), recording.position_mm.resize(40);
  recording.lift_mm.clear();
  write_recording(path("recording"), recording);
  expect_failure(stream("--recording recording"), 1, "no picture, expected 0.11 s of signal");
}

TEST_F(Streaming, AFullDiskIsOneLineAndLeavesNothing) {
  record(40);
  fs::create_directory(path("full"));
  const ProcessResult result = stream("--recording recording --out full/out", {.max_file_bytes = 20'000});
  expect_failure(result, 1, "full/out");
  EXPECT_TRUE(fs::is_empty(path("full")));
}

// A real one, where the kernel lets anybody have one.
TEST_F(Streaming, ADiskThatBecomesFullEndsTheRecordingAndKeepsIt) {
  if (run("/usr/bin/unshare -rm mount -t tmpfs none /mnt").code != 0)
    GTEST_SKIP() << "no file system of one's own here";
  write_recording(path("recording"), simulate_pass(Plate::named("bumps12"), {.speed_mm_s = 4}));
  fs::create_directory(path("full"));
  write_file(path("script"), "mount -t tmpfs -o size=400k none full || exit 9\n" SUPERTAC_BIN
                             "/supertac-stream --recording recording --record full --out full/log --quiet\n"
                             "code=$?; cp full/*.safetensors kept; exit $code");
  const ProcessResult result = run("/usr/bin/unshare -rm sh script");
  expect_failure(result, 1, "the disk is nearly full");
  const Recording all = read_recording(path("recording")), kept = read_recording(path("kept"));
  ASSERT_LT(kept.frames(), all.frames());
  EXPECT_TRUE(contains(result.error, "the " + std::to_string(kept.frames()) + " frames until here are kept"));
  EXPECT_TRUE(std::equal(kept.signals.begin(), kept.signals.end(), all.signals.begin()));
}

TEST_F(Streaming, NothingIsOverwrittenWithoutForce) {
  record(32);
  write_file(path("out"), "mine");
  expect_failure(stream("--recording recording --out out"), 1, "--force");
  EXPECT_EQ(read_text_file(path("out"), 10), "mine");
  EXPECT_EQ(stream("--recording recording --out out --force").code, 0);
  plug_in();
  write_file(path("capture"), "mine");
  expect_failure(stream("--board " + board() + " --capture capture"), 1, "--force");
  const auto recording = read_text_file(path("recording"), 1 << 26);
  EXPECT_NE(stream("--recording recording --mcap recording --force").code, 0);
  EXPECT_EQ(read_text_file(path("recording"), 1 << 26), recording);
}

TEST_F(Streaming, WithoutAPictureNothingIsReplaced) {
  record(32);
  write_file(path("out"), "mine");
  expect_failure(stream("--recording recording --out out --force --seconds 0.01"), 1, "no picture");
  EXPECT_EQ(read_text_file(path("out"), 10), "mine");
  expect_failure(stream("--recording recording --mcap out --out none --force --seconds 0.01"), 1,
                 "no picture");
  EXPECT_EQ(read_text_file(path("out"), 10), "mine");
  EXPECT_FALSE(fs::exists(path("none")));
}

TEST_F(Streaming, DrawsOnATerminalOnly) {
  record(40);
  const std::string line = "supertac-stream --model model --recording recording --seconds 1";
  const double begin = monotonic_seconds();
  const ProcessResult watched = run(line, {.terminal = true});
  EXPECT_GT(monotonic_seconds() - begin, 0.9) << "at the recording's own pace";
  EXPECT_TRUE(contains(watched.error, "frames/s"));
  const ProcessResult script = run(line);
  EXPECT_FALSE(contains(script.error, "\x1b"));
}

TEST_F(Streaming, AnOldCaptureStaysUntilTheNewOneIsComplete) {
  write_file(path("capture"), "old");
  expect_failure(stream("--board no-board --capture capture --force"), 1, "no-board");
  EXPECT_EQ(read_text_file(path("capture"), 100), "old");
  fs::create_directory(path("empty"));
  EXPECT_NE(stream("--board no-board --capture empty --force").code, 0);
  EXPECT_TRUE(fs::exists(path("empty")));
  plug_in();
  ASSERT_EQ(stream("--board " + board() + " --seconds 0.5 --capture capture --force").code, 0);
  const ProcessResult replayed = stream("--replay capture");
  EXPECT_EQ(replayed.code, 0) << replayed.error;
  EXPECT_FALSE(fs::exists(path("capture.new")));
  EXPECT_FALSE(contains(replayed.error, "damaged"));
  fs::resize_file(path("capture"), fs::file_size(path("capture")) - 5);
  const ProcessResult cut = run("supertac-stream --model " + model() + " --replay capture");
  EXPECT_TRUE(contains(cut.error, " damaged bytes of the journal are missing"));
}

TEST_F(Streaming, AModelThatDrawsNoNumbersIsRefused) {
  record(40);
  TensorFile broken(SafetensorsFile::read(model()));
  for (TensorFile::Entry& tensor : broken.tensors) std::ranges::fill(tensor.bytes, std::byte{0xFF});  // NaN
  broken.write(model());
  expect_failure(stream("--recording recording"), 1, " holds NaN or infinity");
}

}  // namespace supertac::stream_test
