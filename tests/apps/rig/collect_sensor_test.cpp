// supertac-collect with a sensor of a file, on a bed of a file: an 8x8 mat on a pseudo-terminal that feels
// what lies under the virtual printer's head.
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <random>
#include <thread>

#include "data/recordings/recording.h"
#include "data/simulation/simulator.h"
#include "hardware/collection/collection.h"
#include "hardware/ports/serial_port.h"
#include "io/files/file.h"
#include "tests/apps/common/expect.h"
#include "tests/apps/rig/collect_run.h"
#include "tests/apps/web/http_client.h"
#include "tests/hardware/fake_sensor.h"
#include "tests/support/test.h"

namespace supertac::collect_sensor_test {

constexpr const char* kBed = R"({"plate": [300, 310, 91.81], "origin": [310, 315, 121.81],
  "low": [200, 200, 0], "high": [400, 420, 200], "first_x_mm": 15, "shift_mm": 3, "passes": 2,
  "slide_mm": 80, "speed_mm_s": 20})";
constexpr Point3 kPlate{300, 310, kSlideZ};

RigSettings on_the_bed() {
  RigSettings settings = CollectRun::running();
  settings.printer.head = {310, 315, 121.81};
  return settings;
}

SimulatorSettings without_disturbances() {
  SimulatorSettings settings;
  settings.array = {.rows = 8, .columns = 8, .pitch_mm = 2};
  settings.noise_volts = settings.emi_volts = settings.drift_volts_per_s = settings.vibration_mm = 0;
  return settings;
}

class CollectSensor : public testing::Test {
 protected:
  /// Frames that come up to `late_s` late have no time stamps.
  explicit CollectSensor(double late_s = 0) : late_s_(late_s) {
    sensor_.name = "mat";
    sensor_.array = model_settings_.array;
    sensor_.scale = {.unit = "counts", .rest = 40, .span = -860};
    sensor_.rate_hz = 100;
    sensor_.port = "serial:" + std::string(run_.disk() + "/mat") + "@115200";
    sensor_.frame = {.kind = FrameKind::text};
    if (late_s == 0) sensor_.frame.time = FrameTime{.column = 0, .unit_s = 1e-3};
    write_sensor(OutputPath(run_.disk() + "/mat.json"), sensor_);
    write_file(run_.disk() + "/bed.json", kBed);
    mat_ = std::make_unique<PseudoTerminal>(run_.disk() + "/mat");
    thread_ = std::thread([this] { send(); });
  }
  ~CollectSensor() override {
    stop_ = true;
    thread_.join();
  }

  std::string line(const std::string& more = "") const {
    return "supertac-collect --sensor mat.json --bed bed.json --printer " + run_.printer() +
           " --plate ridges6 --out " + run_.out() + " --speedup " + format(run_.speedup()) +
           " --yes --quiet " + more;
  }
  ProcessResult run(const std::string& line) const { return run_in(run_.disk(), line); }
  RunningProcess start(const std::string& more = "") const { return start_in(run_.disk(), line(more)); }
  void unplug() {
    const std::lock_guard lock(mutex_);
    mat_->unplug();
  }
  std::string journal() const { return run_.out() + "/ridges6_t1_v20.journal"; }

  /// What the mat sends, at a place of its centre on the plate.
  std::vector<double> counts(const Point3& p) const {
    std::vector<double> values = finger_.volts({p.x, p.y, p.z + finger_.slide_z_mm()}, 0);
    for (double& value : values) value = std::round(SignalScale{}.in(sensor_.scale, value));
    return values;
  }

  /// How far the frames of a pass are (mean of counts) from what the mat sends `off_mm` beside their
  /// positions.
  double apart(const Recording& recording, double off_mm) const {
    constexpr std::size_t kEvery = 5;
    double sum = 0, count = 0;
    for (std::size_t i = 0; i < recording.frames(); i += kEvery) {
      const float* p = &recording.position_mm[2 * i];
      const auto expected = counts({double{p[0]}, double{p[1]} + off_mm, double{recording.lift_mm[i]}});
      for (std::size_t s = 0; s < expected.size(); ++s, ++count)
        sum += std::abs(expected[s] - double{recording.signals[64 * i + s]});
    }
    return sum / count;
  }
  /// No place but the recorded one explains what was felt, to a few tenths of a millimetre.
  void expect_true_positions(const Recording& recording) const {
    double best_mm = 0;
    for (double off_mm = -1.5; off_mm < 1.6; off_mm += 0.1)
      if (apart(recording, off_mm) < apart(recording, best_mm)) best_mm = off_mm;
    EXPECT_NEAR(best_mm, 0, 0.35);
    EXPECT_LT(apart(recording, 0), 0.5 * apart(recording, 1.5)) << "shifted it would fit as well";
    EXPECT_GT(std::ranges::max(recording.signals), 200) << "it felt the plate";
    RecordProperty("best_mm", std::to_string(best_mm));
  }

  SimulatorSettings model_settings_ = without_disturbances();
  FingerModel finger_{Plate::named("ridges6"), model_settings_, {}};
  CollectRun run_{5, on_the_bed()};
  Sensor sensor_;

 private:
  double late_s_;
  // 100 frames a second of the rig's clock, each of the head's place half a period before.
  void send() {
    const auto now = [this] { return run_.speedup() * monotonic_seconds(); };
    std::vector<double> values(64, 40);
    std::minstd_rand random(1);
    for (double next = now(); !stop_; next += 0.01) {
      while (!stop_ && now() < next - 0.005) usleep(200);
      Point3 head = run_.head();
      values = counts({head.x - kPlate.x, head.y - kPlate.y, head.z - kPlate.z});
      const std::string line = sent_frame(sensor_, values, next);
      while (!stop_ && now() < next) usleep(200);
      if (late_s_ > 0)
        usleep(static_cast<useconds_t>(1e6 * late_s_ * double(random()) / double(std::minstd_rand::max())));
      const std::lock_guard lock(mutex_);
      if (mat_->descriptor() >= 0 &&
          write(mat_->descriptor(), line.data(), line.size()) != static_cast<ssize_t>(line.size()))
        continue;  // nobody reads
    }
  }

  std::unique_ptr<PseudoTerminal> mat_;
  std::mutex mutex_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

class CollectLateSensor : public CollectSensor {
 protected:
  CollectLateSensor() : CollectSensor(0.1) {}
};

TEST_F(CollectSensor, ItsPassesAreRecordingsAndItsJournalGivesTheSame) {
  const ProcessResult result = run(line());
  ASSERT_EQ(result.code, 0) << result.error;
  EXPECT_EQ(run_.files(),
            "provenance.jsonl ridges6_t1_p1_v20.safetensors ridges6_t1_p2_v20.safetensors "
            "ridges6_t1_v20.journal");
  EXPECT_LT(distance(run_.head(), {310, 315, 121.81}), 0.01);
  succeed_in(run_.disk(), "supertac-import --out again --journal " + journal());
  for (const int pass : {1, 2}) {
    const std::string name = "/ridges6_t1_p" + std::to_string(pass) + "_v20.safetensors";
    const Recording recording = read_recording(run_.out() + name);
    EXPECT_EQ(recording.array, sensor_.array);
    EXPECT_EQ(recording.signal_scale, sensor_.scale);
    EXPECT_EQ(recording.plate, "ridges6");
    EXPECT_EQ(recording.source, "collected");
    EXPECT_NEAR(recording.period_s(), 0.01, 0.002);
    EXPECT_NEAR(recording.position_mm[0], 15 + 3 * (pass - 1), 1e-3);
    EXPECT_NEAR(recording.position_mm[1], 0, 1e-3);
    EXPECT_NEAR(recording.position_mm.back(), 80, 1e-3);
    expect_true_positions(recording);
  }
  EXPECT_EQ(hash_of_recordings(run_.out(), {}), hash_of_recordings(run_.disk() + "/again", {}));
  succeed_in(
      run_.disk(),
      "supertac-train --data out --preset tiny --split pass --epochs 1 --out model.safetensors --quiet");
  // The journal replays as a stream of this sensor.
  const auto latency_of = [&](const std::string& more) {
    const ProcessResult streamed = succeed_in(run_.disk(), "supertac-stream --quiet --json - " + more);
    return nlohmann::json::parse(streamed.out)["latency_ms"]["median"].get<double>();
  };
  // Recorded arrivals by today's clock, and those of a clock that is sped up by one that is not, are hours
  // apart.
  for (const double median_ms : {latency_of("--record streamed --replay " + journal()),
                                 latency_of("--sensor mat.json --speedup 5 --seconds 0.5")}) {
    EXPECT_GT(median_ms, 0);
    EXPECT_LT(median_ms, 60'000);
  }
  const Recording streamed = read_recording(list_recordings(run_.disk() + "/streamed").at(0));
  EXPECT_EQ(streamed.array, sensor_.array);
  EXPECT_EQ(streamed.signal_scale, sensor_.scale);
  EXPECT_GT(streamed.frames(), 1000U);
}

TEST_F(CollectLateSensor, APassOfWhichNoFrameIsDatedIsAnErrorThatKeepsTheJournal) {
  expect_failure(run(line("--passes 1")), 1,
                 "1 passes without a recording, no frame being dated; collect again");
  expect_exit(run("supertac-import --out again --journal " + journal()), 1, "no frame being dated; keep it");
}

TEST_F(CollectSensor, AfterAKillTheJournalAloneIsEnough) {
  RunningProcess program = start();
  ASSERT_TRUE(run_.wait_for_contact(3, program)) << program.wait().error;
  program.send(SIGKILL);
  (void)program.wait();
  for (const char* file : {"/mat.json", "/bed.json"}) std::filesystem::remove(run_.disk() + file);
  const ProcessResult recovered =
      succeed_in(run_.disk(), "supertac-import --out again --journal " + journal());
  EXPECT_TRUE(contains(recovered.out, "cut off"));
  std::string bytes = read_text_file(journal(), 1 << 30);
  bytes[bytes.size() / 2] ^= 1;
  write_file(journal(), bytes);
  const ProcessResult damaged = run("supertac-import --out damaged --journal " + journal());
  EXPECT_TRUE(contains(damaged.out, " frames recovered"));
  EXPECT_TRUE(contains(damaged.out, "s, are missing; the collection was cut off"));
  const Recording recording = read_recording(run_.disk() + "/again/ridges6_t1_p1_v20.safetensors");
  EXPECT_EQ(recording.array, sensor_.array);
  EXPECT_GT(recording.frames(), 150U);
  expect_true_positions(recording);
  run_.wait_for_rest();
}

TEST_F(CollectSensor, UnpluggedInContactItLeavesTheFingerUp) {
  const int port = free_port();
  RunningProcess program = start("--web " + std::to_string(port));
  const std::unique_ptr<HttpClient> page = connect_when_up(port);
  ASSERT_TRUE(page);
  page->send("GET /events HTTP/1.1\r\nHost: 127.0.0.1:" + std::to_string(port) + "\r\n\r\n");
  const auto hello = event_after(page->receive("\n\n"), "event: hello\ndata: ");
  EXPECT_EQ(hello["passes"].get<std::vector<double>>(), (std::vector<double>{15, 18}));
  ASSERT_TRUE(run_.wait_for_contact(2, program)) << program.wait().error;
  const std::string seen = page->receive("\"phase\":\"slide\"");
  EXPECT_TRUE(contains(seen, "\"x\":15.0,\"y\":"));
  unplug();
  const ProcessResult result = program.wait();
  expect_failure(result, 1, "/mat: the device is gone");
  EXPECT_GE(run_.head().z, kLiftedZ - 0.01);
  EXPECT_GT(read_recording(run_.out() + "/ridges6_t1_p1_v20.safetensors").frames(), 50U);
}

TEST_F(CollectSensor, WhatCannotBeIsRefusedBeforeAnythingMoves) {
  const Point3 before = run_.head();
  const auto refuse = [&](const std::string& more, int code, const std::string& says) {
    expect_failure(run(line(more)), code, says);
    EXPECT_FALSE(std::filesystem::exists(run_.out()));
  };
  const std::string bed = "--bed small.json", small = run_.disk() + "/small.json";
  std::string text = kBed;
  write_file(small, text.replace(text.find("420"), 3, "385"));
  refuse(bed, 1, "Y expected 200.00 to 385.00 mm, found 390.00; nothing was sent");
  refuse("--passes 30", 1, "X342.00 Y310.00 Z95.00, below Z95.00 and beside the plate");
  write_file(small, R"({"plate": [300, 310]})");
  refuse(bed, 1, "small.json: \"plate\" must be three numbers of mm");
  refuse("--board " + run_.board(), 2, "--board: only with the rig's board");
  Sensor other = sensor_;
  const auto with_port = [&](const std::string& port) {
    other.port = port;
    write_sensor(OutputPath(run_.disk() + "/other.json"), other);
    return std::string("--sensor other.json");
  };
  refuse(with_port("udp::5005"), 2, "--speedup: only with a sensor at a serial port");
  refuse("--speedup 1 " + with_port(run_.disk() + "/mat.json"), 1, "is a file");
  EXPECT_EQ(run_.head(), before);
}

}  // namespace supertac::collect_sensor_test
