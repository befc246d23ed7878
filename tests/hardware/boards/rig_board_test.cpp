#include "hardware/boards/sensor_reader.h"

#include <unistd.h>

#include "hardware/collection/journal.h"
#include "hardware/ports/errors.h"
#include "hardware/ports/serial_port.h"
#include "hardware/printers/marlin_link.h"
#include "tests/hardware/fake_port.h"
#include "tests/hardware/rig_support.h"
#include "tests/hardware/virtual_rig/rig_world.h"
#include "tests/support/test.h"

namespace supertac::rig_board_test {

constexpr double kPatience = 20;  // seconds of wall time; a loaded machine is no failure

std::uint64_t taken_until_unplugged(
    SensorReader& board, const std::function<void(const ReadFrame&)>& take = [](const ReadFrame&) {}) {
  std::uint64_t taken = 0;
  EXPECT_THROW(
      {
        for (; const auto frame = board.next(kPatience); ++taken) take(*frame);
      },
      PortUnplugged);
  return taken;
}

TEST(RigBoard, DeliversEveryFrameInOrderUntilItIsUnplugged) {
  RigSettings settings = running_rig();
  settings.signals = [](double, double, double, double t) {
    std::array<double, 16> volts{};
    volts.fill(2.0 + 0.1 * (t - 1000));
    return volts;
  };
  SimulatedRig rig(settings);
  SensorReader board({.port = rig.board_port()}, Sensor{});
  rig.run_for(2);
  rig.unplug_board();
  float before = 0;
  const std::uint64_t frames = taken_until_unplugged(board, [&](const ReadFrame& frame) {
    EXPECT_GE(frame.signals[0], before);
    before = frame.signals[0];
    EXPECT_FALSE(frame.suspect);
  });
  EXPECT_EQ(frames, rig.world().board().counters().sent);
  EXPECT_NEAR(static_cast<double>(frames), 2 / rig::kFramePeriodS, 2);
}

TEST(RigBoard, ASlowConsumerLosesTheOldestAndIsTold) {
  SimulatedRig rig(running_rig());
  SensorReader board({.port = rig.board_port()}, Sensor{}, {.queue_frames = 100});
  rig.run_for(1);
  board.stop();
  std::uint64_t taken = 0;
  double first = 0;
  while (const auto frame = board.next(0)) {
    if (taken++ == 0) first = frame->arrival.time_s;
  }
  EXPECT_EQ(taken, 100U);
  EXPECT_EQ(board.counters().dropped + taken, rig.world().board().counters().sent);
  EXPECT_EQ(board.counters().missing, 0U) << "what was dropped is not lost";
  EXPECT_GT(first, 1000.89) << "the newest frames should have been kept";
}

// Bytes handed over in reads of the given sizes, at the given times.
class ScriptedPort : public FakePort {
 public:
  struct Read {
    double time_s;
    std::vector<std::byte> bytes;
  };
  explicit ScriptedPort(std::vector<Read> reads) : reads_(std::move(reads)) {}
  double now() override { return at_ < reads_.size() ? reads_[at_].time_s : 1e9; }
  Received read(std::span<std::byte> buffer, double) override {
    if (at_ == reads_.size()) throw PortUnplugged("script: the end");
    const Read& read = reads_[at_++];
    std::copy(read.bytes.begin(), read.bytes.end(), buffer.begin());
    return {read.bytes.size(), read.time_s};
  }

 private:
  std::vector<Read> reads_;
  std::size_t at_ = 0;
};

std::vector<std::byte> some_frames(int count) {
  std::vector<std::byte> bytes;
  for (int i = 0; i < count; ++i) {
    const auto one = frame_bytes(random_frame(static_cast<std::uint64_t>(i)));
    bytes.insert(bytes.end(), one.begin(), one.end());
  }
  return bytes;
}

// A minute in which the machine stands still is none of half a second's.
TEST(Listen, ListensForAsLongAsTheMachineRuns) {
  std::vector<ScriptedPort::Read> reads;
  for (int i = 0; i < 30; ++i) reads.push_back({10 + 0.04 * i + (i < 3 ? 0 : 60), some_frames(1)});
  const auto never = [] { return false; };
  EXPECT_EQ(listen({.port = std::make_unique<ScriptedPort>(reads)}, "script", 0.5, never).size(), 13U);
}

TEST(RigBoard, StoppingDoesNotWaitForAConsumerThatIsGone) {
  const std::vector<ScriptedPort::Read> reads(10, {10, some_frames(10)});
  SensorReader board({.port = std::make_unique<ScriptedPort>(reads), .live = false}, Sensor{},
                     {.queue_frames = 15});
  ASSERT_TRUE(board.next(kPatience));
  board.stop();
  EXPECT_TRUE(board.next(0));
}

TEST(RigBoard, ReplaysACaptureOfLargerReads) {
  const std::vector<std::byte> bytes = some_frames(60);
  SensorReader board(
      {.port = std::make_unique<ReplayPort>(std::vector<JournalRecord>{{RecordKind::clock, 10, {}},
                                                                       {RecordKind::clock, 10, {}},
                                                                       {RecordKind::received, 10.1, bytes},
                                                                       {RecordKind::clock, 10.1, {}}},
                                            "capture")},
      Sensor{});
  EXPECT_EQ(taken_until_unplugged(board), 60U);
}

TEST(RigBoard, LostFramesAreCountedAndTheNextIsSuspect) {
  SimulatedRig rig(running_rig({}, {.stall_rate = 0.001, .lost_frame_rate = 0.01}));
  SensorReader board({.port = rig.board_port()}, Sensor{}, {.queue_frames = 100'000});
  rig.run_for(10);
  board.stop();
  const VirtualBoard::Counters truth = rig.world().board().counters();
  const ReaderCounters counters = board.counters();
  EXPECT_GT(truth.torn, 0U);
  EXPECT_EQ(counters.decoder.frames, truth.sent);
  // In the first second it is not known yet how late frames come.
  EXPECT_LE(counters.missing, truth.lost);
  EXPECT_NEAR(static_cast<double>(counters.missing), static_cast<double>(truth.lost), 30);
  std::uint64_t suspect = 0;
  double before = 0;
  while (const auto frame = board.next(0)) {
    const bool after_gap = before > 0 && frame->arrival.time_s - before > 1.5 * rig::kFramePeriodS;
    EXPECT_EQ(frame->suspect, after_gap);
    before = frame->arrival.time_s;
    suspect += frame->suspect ? 1 : 0;
  }
  EXPECT_GE(suspect, truth.torn);
}

// Neither board nor printer: noise without a frame, and a device that talks text to the printer's driver.
TEST(RigBoard, AnotherDeviceIsNoBoardAndNoPrinter) {
  const TemporaryFolder folder;
  const PseudoTerminal device(folder / "port");
  const std::string noise(64, '\xAA'), text = "$GPGGA,123519,4807.038,N\r\n";
  {
    SensorReader board(
        {.port = std::make_unique<SerialPort>(folder / "port", SerialSettings{rig::kBoardBaud, 10})},
        Sensor{});
    ASSERT_EQ(write(device.descriptor(), noise.data(), noise.size()), static_cast<ssize_t>(noise.size()));
    EXPECT_ERROR((void)board.next(kPatience), WrongDevice,
                 "found 64 bytes without one, such as '" + std::string(64, '?') +
                     "'; choose the board's port (supertac-check machine), or exchange it and the printer's");
  }
  SerialPort port(folder / "port", {.speedup = 100});
  ASSERT_EQ(write(device.descriptor(), text.data(), text.size()), static_cast<ssize_t>(text.size()));
  MarlinLink link(port);
  EXPECT_ERROR(link.connect(), WrongDevice,
               "expected a Marlin firmware, found 26 bytes that are no answer to M110 within 20 s; check "
               "that it is the "
               "printer's port (supertac-check machine) and that its baud rate is 115200");
}

}  // namespace supertac::rig_board_test
