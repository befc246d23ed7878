#include "hardware/boards/sensor_reader.h"

#include <fcntl.h>
#include <sys/stat.h>

#include "hardware/ports/errors.h"
#include "hardware/ports/serial_port.h"
#include "hardware/virtual_rig/virtual_rig.h"
#include "io/files/file.h"
#include "tests/hardware/fake_sensor.h"
#include "tests/support/sockets.h"
#include "tests/support/test.h"

namespace supertac::sensor_reader_test {

std::vector<double> numbered(const Sensor& sensor, int frame) {
  std::vector<double> values(sensor.values(), 7);
  values.front() = frame;
  return values;
}

// All frames until the end, or until as many have come.
std::vector<ReadFrame> all_of(SensorReader& reader, std::size_t most = 1'000'000) {
  std::vector<ReadFrame> frames;
  const double until = monotonic_seconds() + 200;
  while (frames.size() < most && !reader.ended() && monotonic_seconds() < until)
    if (auto frame = reader.next(0.05)) frames.push_back(std::move(*frame));
  return frames;
}

/// Sends datagrams to a free port of this computer.
class UdpSender {
 public:
  UdpSender() = default;
  ~UdpSender() { close(out_); }
  UdpSender(const UdpSender&) = delete;
  UdpSender& operator=(const UdpSender&) = delete;
  std::string port() const { return std::to_string(ntohs(to_.sin_port)); }
  void send(const std::string& bytes) const {
    sendto(out_, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&to_), sizeof to_);
  }

 private:
  int out_ = socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in to_ = at_port(free_port(SOCK_DGRAM));
};

std::string refusal(const std::string& address) {
  return what_of<PortError>([&] { open_port(address); });
}

TEST(OpenPort, RefusesInOneLine) {
  EXPECT_EQ(refusal("serial:/dev/ttyACM0"),
            "port serial:/dev/ttyACM0: expected serial:DEVICE@BAUD, such as serial:/dev/ttyACM0@115200");
  EXPECT_EQ(refusal("udp:5005"),
            "port udp:5005: expected udp:[HOST]:PORT or tcp:HOST:PORT, such as udp::5005");
  EXPECT_EQ(refusal("tcp::5005"),
            "port tcp::5005: expected udp:[HOST]:PORT or tcp:HOST:PORT, such as udp::5005");
  EXPECT_EQ(refusal("/nowhere"),
            "port /nowhere: No such file or directory; expected serial:DEVICE@BAUD, udp:[HOST]:PORT, "
            "tcp:HOST:PORT, - or a file");
  EXPECT_EQ(refusal("/tmp"), "port /tmp: expected a file or FIFO, found a folder");
  EXPECT_EQ(refusal("tcp:127.0.0.1:" + std::to_string(free_port(SOCK_STREAM))).find("port tcp:127.0.0.1:"),
            0U);
}

// Without stamps frames are a period apart: they were dated by the speed at which the file was read.
TEST(SensorReader, ReadsAFileToItsEndWithoutLoss) {
  for (const char* time : {R"(,"time":{"column":0,"unit":"ms"})", ""}) {
    const TemporaryFolder folder;
    const Sensor sensor = mat(2, 3, 100, R"({"kind":"text")" + std::string(time) + "}");
    std::string text = "booting\n";
    for (int n = 0; n < 30'000; ++n) text += sent_frame(sensor, numbered(sensor, n), 5 + 0.01 * n);
    text.resize(text.size() - 2);  // no line feed behind the last
    write_file(folder / "frames.csv", text);
    SensorReader reader(open_port(folder / "frames.csv"), sensor);
    EXPECT_FALSE(reader.live());
    while (reader.counters().decoder.frames == 0) usleep(1000);  // it runs into its full queue
    const std::vector<ReadFrame> frames = all_of(reader);
    ASSERT_EQ(frames.size(), 30'000U);
    EXPECT_NEAR(frames.back().date.time_s - frames.front().date.time_s, 299.99, 1e-6);
    EXPECT_EQ(frames.back().signals.front(), 29'999);
    const ReaderCounters counters = reader.counters();
    EXPECT_EQ(counters.decoder.torn, 1U);  // "booting"
    EXPECT_EQ(counters.missing + counters.dropped, 0U);
  }
}

TEST(SensorReader, CountsWhatIsLostLateAndDamaged) {
  const TemporaryFolder folder;
  const Sensor sensor = mat(1, 2, 100, R"({"kind":"text","time":{"column":0,"unit":"ms"}})");
  std::string text;
  for (int n = 0; n < 300; ++n) {
    if (n >= 100 && n < 103) continue;
    text += n == 150   ? "1500,nan,7\n"
            : n == 170 ? "1690,1,7\n"  // as the one before
            : n == 190 ? "1900,1\n"
                       : std::to_string(10 * n) + "," + std::to_string(n) + ",7\n";
  }
  write_file(folder / "frames.csv", text);
  SensorReader reader(open_port(folder / "frames.csv"), sensor);
  EXPECT_EQ(all_of(reader).size(), 295U);
  const ReaderCounters counters = reader.counters();
  EXPECT_EQ(counters.damaged, 1U);
  EXPECT_EQ(counters.decoder.torn, 1U);
  EXPECT_EQ(counters.missing, 5U);
}

// What the reader says of a device that sends milliseconds for two seconds, which its file calls `unit`;
// those of the first half second are `off_ms` off.
std::string said_of_clock(const std::string& unit, long off_ms) {
  const TemporaryFolder folder;
  const PseudoTerminal device(folder / "port");
  std::string said = "nothing";
  try {
    SensorReader reader(open_port("serial:" + device.path() + "@115200"),
                        mat(1, 2, 100, R"({"kind":"text","time":{"column":0,"unit":")" + unit + "\"}}"));
    const double begin = monotonic_seconds();
    for (double now = 0; now < 2; now = monotonic_seconds() - begin) {
      const std::string line = std::to_string(std::lround(1000 * now) + (now < 0.5 ? off_ms : 0)) + ",1,2\n";
      EXPECT_EQ(write(device.descriptor(), line.data(), line.size()), static_cast<ssize_t>(line.size()));
      while (reader.next(0.01)) continue;
    }
  } catch (const WrongDevice& error) {
    said = error.what();
  }
  return said;
}

TEST(SensorReader, AClockInAnotherUnitIsRefused) {
  for (const char* unit : {"s", "us"})
    EXPECT_NE(said_of_clock(unit, 0).find("unit (s, ms, us) of time"), std::string::npos) << unit;
  EXPECT_EQ(said_of_clock("ms", 0), "nothing");
  EXPECT_EQ(said_of_clock("ms", -5'000'000), "nothing") << "it was set after half a second";
}

TEST(SensorReader, LosesNothingOfAThousandFramesOf16x16OverUdp) {
  const Sensor sensor = mat(16, 16, 1000, R"({"kind":"binary","header":"AA55","type":"u16"})");
  const UdpSender out;
  SensorReader reader(open_port("udp:127.0.0.1:" + out.port()), sensor);
  // The kernel keeps some 200 kB for a reader: one whose machine is busy elsewhere is waited for.
  constexpr std::uint64_t kUnderWay = 64;
  const std::jthread sender([&](const std::stop_token& over) {
    for (std::uint64_t n = 0; n < 2000; ++n) {
      while (!over.stop_requested() && n > reader.counters().decoder.frames + kUnderWay) usleep(1000);
      out.send(sent_frame(sensor, numbered(sensor, static_cast<int>(n)), 0));
    }
  });
  const std::vector<ReadFrame> frames = all_of(reader, 2000);
  ASSERT_EQ(frames.size(), 2000U);
  for (int n = 0; n < 2000; ++n) ASSERT_EQ(frames[static_cast<std::size_t>(n)].signals.front(), n);
}

TEST(SensorReader, ADatagramOfTextIsALine) {
  const Sensor sensor = mat(1, 3, 100, R"({"kind":"text"})");
  const UdpSender out;
  SensorReader reader(open_port("udp::" + out.port(), true), sensor);
  for (int n = 0; n < 20; ++n) out.send("1,2,3");
  EXPECT_EQ(all_of(reader, 20).size(), 20U);
}

// A datagram of nothing is none, and does not prolong the wait.
TEST(OpenPort, EmptyDatagramsAreNotReadBeyondTheDeadline) {
  const UdpSender out;
  const OpenedPort opened = open_port("udp::" + out.port());
  for (const char* bytes : {"", "", "x"}) out.send(bytes);
  std::array<std::byte, 16> buffer{};
  EXPECT_EQ(opened.port->read(buffer, 0).count, 0U);
  EXPECT_EQ(opened.port->read(buffer, opened.port->now() + 10).count, 1U);
}

TEST(SensorReader, ReadsTcpUntilTheOtherSideIsGone) {
  const Sensor sensor = mat(2, 2, 100, R"({"kind":"json"})");
  const int port = free_port(SOCK_STREAM), server = socket(AF_INET, SOCK_STREAM, 0);
  const sockaddr_in at = at_port(port);
  ASSERT_EQ(bind(server, reinterpret_cast<const sockaddr*>(&at), sizeof at), 0);
  ASSERT_EQ(::listen(server, 1), 0);
  SensorReader reader(open_port("tcp:127.0.0.1:" + std::to_string(port)), sensor);
  const int client = accept(server, nullptr, nullptr);
  for (int n = 0; n < 50; ++n) {
    const std::string frame = sent_frame(sensor, numbered(sensor, n), 0);
    ASSERT_EQ(send(client, frame.data(), frame.size(), 0), static_cast<ssize_t>(frame.size()));
  }
  EXPECT_EQ(all_of(reader, 50).size(), 50U);
  close(client);
  close(server);
  EXPECT_THROW(all_of(reader), PortUnplugged);
}

TEST(SensorReader, WaitsForTheWriterOfAFifo) {
  const TemporaryFolder folder;
  const std::string path = folder / "fifo";
  ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);
  const Sensor sensor = mat(1, 2, 100, R"({"kind":"text"})");
  SensorReader reader(open_port(path), sensor);
  EXPECT_FALSE(reader.next(0.1));
  EXPECT_FALSE(reader.ended());
  const int out = open(path.c_str(), O_WRONLY);
  ASSERT_EQ(write(out, "1,2\n3,4\n", 8), 8);
  close(out);
  EXPECT_EQ(all_of(reader).size(), 2U);
}

TEST(SensorReader, ASourceThatWasToGoOnMayNotEnd) {
  const TemporaryFolder folder;
  write_file(folder / "frames", "1,2\n3,4\n");
  const Sensor sensor = mat(1, 2, 100, R"({"kind":"text"})");
  OpenedPort opened = open_port(folder / "frames");
  opened.live = true;
  SensorReader reader(std::move(opened), sensor);
  while (what_of<PortUnplugged>([&] { reader.check(); }) == "nothing thrown") usleep(1000);
  EXPECT_ERROR(reader.check(), PortUnplugged, "frames: what it sends has ended; see whether");
  EXPECT_TRUE(reader.next(0));
  EXPECT_TRUE(reader.next(0));
  EXPECT_THROW(reader.next(0), PortUnplugged);
}

TEST(SensorReader, WhatComesWithoutAFrameIsSaid) {
  const TemporaryFolder folder;
  const PseudoTerminal device(folder / "port");
  const Sensor sensor = mat(2, 2, 1000, R"({"kind":"text"})");
  const auto send = [&](const std::string& line) {
    return write(device.descriptor(), line.data(), line.size()) > 0;
  };
  const std::string at = "serial:" + device.path() + "@115200";
  auto reader = std::make_unique<SensorReader>(open_port(at), sensor);
  const std::string busy = "echo:busy: " + std::string(98, 'p') + " for now\n" + std::string(60, 'q');
  ASSERT_TRUE(send(busy));
  EXPECT_ERROR(all_of(*reader), WrongDevice,
               "sensor sensor at " + device.path() +
                   ": expected frames of 4 values, found 178 bytes without "
                   "one, such as '" +
                   busy.substr(0, 117) + "?qq'; supertac-stream --probe says what they are");
  reader.reset();  // the port is one reader's
  reader = std::make_unique<SensorReader>(open_port(at), sensor);
  ASSERT_TRUE(send("1,2,3,4\n") && reader->next(10) && send("1,2,1,2,1,2"));
  EXPECT_ERROR(all_of(*reader), BoardSilent,
               "found none for 3.0 s in 11 bytes, such as '1,2,1,2,1,2'; see whether it was switched off or");
}

}  // namespace supertac::sensor_reader_test
