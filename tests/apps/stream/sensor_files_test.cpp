// Every file of examples/sensors/ against a device that sends such frames: probed, viewed, recorded, read
// back. Then from simulated passes of one of them to live pictures.
#include <fcntl.h>
#include <pty.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <nlohmann/json.hpp>
#include <thread>

#include "data/recordings/recording.h"
#include "data/simulation/simulator.h"
#include "io/files/file.h"
#include "io/files/json.h"
#include "io/numbers/random.h"
#include "tests/apps/common/expect.h"
#include "tests/hardware/fake_sensor.h"
#include "tests/support/sockets.h"
#include "tests/support/test.h"

namespace supertac::sensor_files_test {

/// Sends a sensor's frames in real time, over the kind of port that its file names, until it is destroyed.
class FakeDevice {
 public:
  explicit FakeDevice(const Sensor& sensor) : sensor_(sensor) {
    std::signal(SIGPIPE, SIG_IGN);
    if (sensor.port.starts_with("serial:"))
      open_terminal();
    else if (sensor.port.starts_with("udp:"))
      open_socket(SOCK_DGRAM, "udp:127.0.0.1:");
    else if (sensor.port.starts_with("tcp:"))
      open_socket(SOCK_STREAM, "tcp:127.0.0.1:");
    else
      open_fifo();
    thread_ = std::thread([this] { run(); });
  }
  ~FakeDevice() {
    stop_ = true;
    thread_.join();
    for (const int file : {listening_, out_, slave_})
      if (file >= 0) close(file);
  }
  const std::string& port() const { return port_; }

  /// Whole numbers in the sensor's range: rest and noise, and for 0.3 s of every second a finger.
  std::vector<double> values(int n) const {
    const RandomStream random(5, static_cast<std::uint64_t>(n));
    const bool pressed = std::fmod(n / sensor_.rate_hz, 1.0) > 0.7 || (sensor_.rate_hz < 10 && n % 4 == 3);
    std::vector<double> values;
    for (std::size_t i = 0; i < sensor_.values(); ++i) {
      const double noise = 0.005 * random.uniform(i), press = pressed && i % 5 == 1 ? 0.6 : 0;
      values.push_back(std::round(sensor_.scale.rest - sensor_.scale.span * (0.02 + noise + press)));
    }
    return values;
  }

 private:
  void open_terminal() {
    char name[100];
    ASSERT_EQ(openpty(&out_, &slave_, name, nullptr, nullptr), 0);
    fcntl(out_, F_SETFL, O_NONBLOCK);
    port_ = "serial:" + std::string(name) + sensor_.port.substr(sensor_.port.rfind('@'));
  }
  void open_socket(int type, const std::string& prefix) {
    const int port = free_port(type);
    const sockaddr_in address = at_port(port);
    const auto* const at = reinterpret_cast<const sockaddr*>(&address);
    port_ = prefix + std::to_string(port);
    int& file = type == SOCK_STREAM ? listening_ : out_;  // of datagrams the program is who listens
    file = socket(AF_INET, type | SOCK_NONBLOCK, 0);
    ASSERT_TRUE(type == SOCK_DGRAM ? connect(file, at, sizeof address) == 0
                                   : bind(file, at, sizeof address) == 0 && ::listen(file, 1) == 0);
  }
  void open_fifo() {
    port_ = folder_ / "fifo";
    ASSERT_EQ(mkfifo(port_.c_str(), 0600), 0);
  }
  bool connected() {
    if (out_ < 0 && listening_ >= 0) out_ = accept(listening_, nullptr, nullptr);
    if (out_ < 0 && listening_ < 0) out_ = open(port_.c_str(), O_WRONLY | O_NONBLOCK);
    if (out_ >= 0 && listening_ < 0 && port_.starts_with("/")) fcntl(out_, F_SETFL, 0);
    return out_ >= 0;
  }
  void run() {
    const auto begin = std::chrono::steady_clock::now();
    bool taken = false;
    for (int n = 0; !stop_; ++n) {
      // What nobody took is gone; what a busy machine kept this thread from sending follows at once.
      const std::chrono::duration<double> past = std::chrono::steady_clock::now() - begin;
      if (!taken) n = std::max(n, static_cast<int>(past.count() * sensor_.rate_hz));
      std::this_thread::sleep_until(begin + std::chrono::duration<double>(n / sensor_.rate_hz));
      taken = connected();
      if (!taken) continue;
      const std::string bytes = sent_frame(sensor_, values(n), n / sensor_.rate_hz);
      for (std::string_view left = bytes; !left.empty() && !stop_;) {
        const ssize_t count = write(out_, left.data(), left.size());
        if (count > 0) left.remove_prefix(static_cast<std::size_t>(count));
        if (count > 0) continue;
        taken = false;
        if (errno == EAGAIN) {
          usleep(1000);
          continue;
        }
        if (slave_ < 0 && !port_.starts_with("udp:")) close(std::exchange(out_, -1));  // the next client
        break;
      }
    }
  }

  Sensor sensor_;
  TemporaryFolder folder_;
  std::string port_;
  int listening_ = -1, out_ = -1, slave_ = -1;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

Sensor example(const std::string& name) {
  return read_sensor(SUPERTAC_SOURCE "/examples/sensors/" + name + ".json");
}

// Every recorded frame is one that was sent, in the order of sending.
void expect_sent(const Recording& recording, const FakeDevice& device, const Sensor& arranged) {
  std::map<std::vector<float>, std::set<int>> sent;
  for (int n = 0; n < 20'000 && static_cast<double>(n) < 120 * arranged.rate_hz; ++n) {
    const std::vector<double> values = device.values(n);
    std::vector<float> signals(arranged.array.signals());
    arranged.arrange(std::vector<float>(values.begin(), values.end()), signals);
    sent[signals].insert(n);
  }
  const std::size_t signals = arranged.array.signals();
  int before = -1;
  for (std::size_t i = 0; i < recording.frames(); ++i) {
    const auto first = recording.signals.begin() + static_cast<std::ptrdiff_t>(i * signals);
    const auto found = sent.find({first, first + static_cast<std::ptrdiff_t>(signals)});
    ASSERT_NE(found, sent.end()) << "frame " << i << " was never sent";
    const auto next = found->second.upper_bound(before);
    ASSERT_NE(next, found->second.end()) << "frame " << i << " was sent before the one before it";
    before = *next;
  }
}

using SensorFiles = ProgramTest;
class SensorFile : public ProgramTest, public testing::WithParamInterface<const char*> {};

TEST_P(SensorFile, IsProbedViewedRecordedAndReadBack) {
  Sensor sensor = example(GetParam());
  sensor.body.skin_mm = 2, sensor.body.knee = 0.5;
  const bool slow = sensor.rate_hz < 10;
  const std::string seconds = slow ? "6" : "4";
  const FakeDevice device(sensor);
  sensor.port = device.port();

  const ProcessResult probed = succeed("supertac-stream --sensor " + device.port() + " --probe --seconds " +
                                       seconds + " --out draft.json --quiet");
  Sensor draft = read_sensor(path("draft.json"));
  EXPECT_EQ(draft.values(), sensor.values()) << probed.out;
  EXPECT_EQ(draft.frame.kind, sensor.frame.kind);
  EXPECT_EQ(draft.scale.rises(), sensor.scale.rises()) << probed.out;
  EXPECT_EQ(draft.frame.time.has_value(), sensor.frame.time.has_value()) << probed.out;
  EXPECT_NEAR(draft.rate_hz, sensor.rate_hz, 0.2 * sensor.rate_hz) << probed.out;

  draft.dead.clear();
  write_sensor(path("sensor.json"), sensor);
  write_sensor(path("draft.json"), draft);
  for (const auto& [file, described] :
       std::map<std::string, Sensor>{{"draft.json", draft}, {"sensor.json", sensor}}) {
    SCOPED_TRACE(file);
    const ProcessResult streamed = succeed("supertac-stream --sensor " + file + " --record " + file +
                                           ".recordings --plate ridges6 --seconds " + (slow ? "3.5" : "1") +
                                           " --out - --json " + file + ".result --quiet");
    const Recording recording = read_recording(path(file + ".recordings/ridges6_t1_p1_v0.safetensors"));
    EXPECT_GE(recording.frames(), slow ? 3U : 20U);
    EXPECT_EQ(recording.array, described.array);
    EXPECT_EQ(recording.signal_scale, described.scale);
    EXPECT_EQ(recording.body.value_or(Body::usual(recording.array)), described.body);
    EXPECT_NEAR(recording.period_s(), 1 / sensor.rate_hz, 0.3 / sensor.rate_hz);
    Sensor arranged = described;
    arranged.rate_hz = sensor.rate_hz;
    expect_sent(recording, device, arranged);
    // What a reader of lines sees is what is recorded.
    const std::string line = streamed.out.substr(0, streamed.out.find('\n'));
    EXPECT_EQ(parse_json_limited(line).at(signals_tensor(described.scale)).size(), described.array.signals());
    EXPECT_EQ(static_cast<std::size_t>(std::ranges::count(streamed.out, '\n')), recording.frames());
  }
}

// From passes over a plate, or, of a mat far larger than a plate that sends a frame a second, from presses.
TEST_P(SensorFile, LearnsFromSimulationAndDrawsLive) {
  Sensor sensor = example(GetParam());
  const bool slow = sensor.rate_hz < 10;  // a window of 32 frames would take half a minute
  write_sensor(path("sensor.json"), sensor);
  succeed("supertac-simulate --sensor sensor.json --out simulated " +
          std::string(slow ? "--presses 14" : "--plates ridges6 --passes 2 --trials 1 --speeds 10"));
  succeed("supertac-train --data simulated --out model --split none --epochs 1 --stride 16 --preset " +
          std::string(slow ? "frame" : "tiny --timesteps 32"));
  const FakeDevice device(sensor);
  sensor.port = device.port();
  write_sensor(path("sensor.json"), sensor);
  const ProcessResult streamed =
      succeed("supertac-stream --sensor sensor.json --model model --out - --quiet --seconds " +
              std::string(slow ? "3.5" : "1.5"));
  const auto line = parse_json_limited(streamed.out.substr(0, streamed.out.find('\n')));
  EXPECT_EQ(line.at("picture").size(), 16U * static_cast<std::size_t>(sensor.array.taxels()));
}

INSTANTIATE_TEST_SUITE_P(Examples, SensorFile,
                         testing::Values("csv_arduino", "json_lines", "binary_header", "flexitac_12x32",
                                         "uskin_4x4x3", "anyskin", "mat_32x64"),
                         [](const auto& file) { return std::string(file.param); });

TEST_F(SensorFiles, AnotherRateThanTheFileSaysIsSaid) {
  Sensor sensor = example("json_lines");
  sensor.rate_hz = 40;
  const FakeDevice device(sensor);
  sensor.port = device.port();
  const auto said = [&](double stated_hz) {
    sensor.rate_hz = stated_hz;
    write_sensor(path("sensor.json"), sensor);
    return run("supertac-stream --sensor sensor.json --seconds 2 --quiet").out;
  };
  EXPECT_FALSE(contains(said(40), "is said to send"));
  const std::string slow = said(100);
  EXPECT_TRUE(contains(slow, " frames came a second, the sensor is said to send 100.0"));
  EXPECT_TRUE(contains(said(45), "is said to send 45.0: correct rate_hz in its file"));
  EXPECT_TRUE(contains(slow, "lost 0,"));
}

// Where each taxel rests and its gain go into the file, whose other words stay.
TEST_F(SensorFiles, GainsAreFoundWhilePressing) {
  Sensor sensor = example("csv_arduino");
  const FakeDevice device(sensor);
  sensor.port = device.port();
  write_sensor(path("sensor.json"), sensor);
  const ProcessResult probed =
      succeed("supertac-stream --sensor sensor.json --probe --gain --seconds 4 --out even.json");
  EXPECT_TRUE(contains(probed.error, "listening for 4 s: press every taxel equally hard"));
  EXPECT_TRUE(contains(probed.out, "not pressed, or far more weakly than the others: taxels [0,"));
  Sensor even = read_sensor(path("even.json"));
  ASSERT_EQ(even.gain.size(), sensor.array.signals());
  for (const float gain : even.gain) EXPECT_NEAR(gain, 1, 0.05);
  for (const float rest : even.rest)
    EXPECT_NEAR(rest, sensor.scale.rest - 0.0225 * sensor.scale.span, 0.01 * std::abs(sensor.scale.span));
  even.gain.clear(), even.rest.clear();
  EXPECT_EQ(even, sensor);
  EXPECT_EQ(run("supertac-stream --sensor " + device.port() + " --gain").code, 2);
}

// What is recorded is what the tracker makes of the frames that were sent.
TEST_F(SensorFiles, ARestThatDriftsIsFollowedWhereTheFileAsks) {
  Sensor sensor = example("csv_arduino");
  sensor.dead.clear(), sensor.follow_rest_s = 3, sensor.port = path("bytes");
  std::string bytes;
  const double rest = sensor.scale.rest, span = sensor.scale.span;
  for (int n = 0; n < 40 * sensor.rate_hz; ++n) {  // a drift by a tenth of the range, and at last a finger
    const double time_s = n / sensor.rate_hz;
    std::vector<double> values(sensor.values(), rest - span * 0.0025 * time_s);
    if (time_s > 38) values[3] -= 0.5 * span;
    bytes += sent_frame(sensor, values, time_s);
  }
  write_file(sensor.port, bytes);
  write_sensor(path("sensor.json"), sensor);
  succeed("supertac-stream --sensor sensor.json --record kept --quiet");
  const Recording recording = read_recording(path("kept/unknown_t1_p1_v0.safetensors"));
  const std::size_t last = recording.frames() - 1;
  ASSERT_GT(static_cast<double>(last), 36 * sensor.rate_hz);
  const auto share = [&](std::size_t frame, std::size_t k) {
    return (rest - double{recording.signals[frame * sensor.array.signals() + k]}) / span;
  };
  EXPECT_NEAR(share(last / 2, 0), 0, 0.01);
  EXPECT_NEAR(share(last, 0), 0, 0.02);
  EXPECT_NEAR(share(last, 3), 0.5, 0.02);
}

TEST_F(SensorFiles, OthersAtThePortAreToldApart) {
  std::string noise, log;
  const RandomStream random(1, 2);
  for (std::size_t i = 0; i < 40'000; ++i) noise += static_cast<char>(random.bits(i));
  for (int i = 0; i < 50; ++i)
    log += "[info] the weather is " + std::string(i % 2 == 0 ? "fine" : "not so fine") + "\n";
  std::string printer = "start\necho:Marlin 2.1.2\n";
  for (int i = 0; i < 20; ++i) printer += "ok T:20.1 /0.0\n";
  const std::map<std::string, std::string> heard = {{noise, "binary without a period"},
                                                    {log, "a log, or words"},
                                                    {printer, "a printer's firmware answers here"},
                                                    {"", "nothing came"}};
  for (const auto& [bytes, words] : heard) {
    write_file(path("port"), bytes);
    const auto probed = run("supertac-stream --sensor port --probe --quiet");
    EXPECT_EQ(probed.code, 1) << words;
    EXPECT_TRUE(contains(probed.out + probed.error, words));
  }
}

// Simulated passes of the mat train a model that draws what the mat feels; the same signals in volts that
// fall, in another order and unit, give the same pictures.
TEST_F(SensorFiles, FromSimulatedPassesToLivePictures) {
  Sensor mat = example("csv_arduino");
  mat.array.rows = mat.array.columns = 4, mat.array.pitch_mm = 3, mat.dead.clear(), mat.rate_hz = 100;
  for (int pass = 1; pass <= 2; ++pass) {
    Recording recording =
        simulate_pass(Plate::named("bumps12"), {.pass = pass}, {.array = mat.array, .rate_hz = 100});
    restate(recording, mat.scale);
    write_recording(path("p" + std::to_string(pass) + ".safetensors"), recording);
  }
  succeed(
      "supertac-train --data . --out model.st --preset tiny --timesteps 32 --epochs 1 --stride 20 --split "
      "none");
  Sensor volts = mat;  // column by column, falling, in millivolts
  volts.scale = {.unit = "mV", .rest = 3300, .span = 2500};
  volts.order = {0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15};
  volts.frame = {.kind = FrameKind::binary, .header = "\xAA\x55", .type = "f32"};
  volts.frame.time = FrameTime{.type = "u32", .unit_s = 1e-3};
  const Recording pass =
      simulate_pass(Plate::named("bumps12"), {.pass = 3}, {.array = mat.array, .rate_hz = 100});
  std::vector<std::vector<float>> pictures;
  for (Sensor sensor : {mat, volts}) {
    std::string bytes;
    for (std::size_t i = 0; i < 400; ++i) {
      std::vector<double> values(16);
      for (std::size_t k = 0; k < 16; ++k) {
        const std::size_t place = sensor.order.empty() ? k : static_cast<std::size_t>(sensor.order[k]);
        values[place] = SignalScale{}.in(sensor.scale, double{pass.signals[i * 16 + k]});
      }
      bytes += sent_frame(sensor, values, 0.01 * static_cast<double>(i));
    }
    const std::string unit = sensor.scale.unit;
    sensor.port = path(unit + ".bytes");
    write_file(sensor.port, bytes);
    write_sensor(path(unit + ".json"), sensor);
    succeed("supertac-stream --sensor " + unit + ".json --model model.st --quiet --out " + unit +
            ".pictures");
    pictures.push_back(SafetensorsFile::read(path(unit + ".pictures")).f32("pictures"));
  }
  ASSERT_EQ(pictures[0].size(), pictures[1].size());
  ASSERT_GT(pictures[0].size(), 256U * 300);
  float worst = 0;
  for (std::size_t i = 0; i < pictures[0].size(); ++i)
    worst = std::max(worst, std::abs(pictures[0][i] - pictures[1][i]));
  EXPECT_LT(worst, 1e-5F);
}

}  // namespace supertac::sensor_files_test
