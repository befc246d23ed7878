#include "hardware/tactile_board.h"

#include <gtest/gtest.h>

#include "hardware/errors.h"
#include "hardware/marlin_link.h"
#include "hardware/serial_port.h"
#include "hardware/virtual_rig/pty_rig.h"
#include "rig_support.h"

namespace supertac {
namespace {

constexpr double kPatience = 20;  // seconds of wall time; a loaded machine is no failure

TEST(TactileBoard, DeliversEveryFrameInOrder) {
  RigSettings settings = running_rig();
  settings.board.signals = [](double, double, double, double t) {
    std::array<double, 16> volts{};
    volts.fill(2.0 + 0.1 * (t - 1000));
    return volts;
  };
  SimulatedRig rig(settings);
  TactileBoard board(rig.board_port());
  rig.run_for(2);
  board.stop();
  std::uint64_t frames = 0;
  std::uint16_t before = 0;
  while (const auto frame = board.next(0)) {
    EXPECT_GE(frame->frame.taxel(0), before);
    before = frame->frame.taxel(0);
    EXPECT_FALSE(frame->suspect);
    ++frames;
  }
  EXPECT_EQ(frames, rig.world().board().counters().sent);
  EXPECT_NEAR(static_cast<double>(frames), 2 / kFramePeriod, 2);
}

TEST(TactileBoard, ASlowConsumerLosesTheOldestAndIsTold) {
  SimulatedRig rig(running_rig());
  TactileBoard board(rig.board_port(), {.queue_frames = 100});
  rig.run_for(1);
  board.stop();
  std::uint64_t taken = 0;
  double first = 0;
  while (const auto frame = board.next(0)) {
    if (taken++ == 0) first = frame->arrival_s;
  }
  EXPECT_EQ(taken, 100U);
  EXPECT_EQ(board.counters().dropped + taken, rig.world().board().counters().sent);
  EXPECT_GT(first, 1000.89) << "the newest frames should have been kept";
}

TEST(TactileBoard, LostFramesAreCountedAndTheNextIsSuspect) {
  RigSettings settings = running_rig();
  settings.faults.lost_frame_rate = 0.01;
  settings.faults.stall_rate = 0.001;
  SimulatedRig rig(settings);
  TactileBoard board(rig.board_port(), {.queue_frames = 100'000});
  rig.run_for(10);
  board.stop();
  const VirtualBoard::Counters truth = rig.world().board().counters();
  const BoardCounters counters = board.counters();
  EXPECT_GT(truth.torn, 0U);
  EXPECT_EQ(counters.decoder.frames, truth.sent);
  // The last 64 frames are not decided yet, and what was lost before the first or after the last cannot be
  // seen.
  EXPECT_NEAR(static_cast<double>(counters.missing), static_cast<double>(truth.lost), 24);
  std::uint64_t suspect = 0;
  double before = 0;
  while (const auto frame = board.next(0)) {
    const bool after_gap = before > 0 && frame->arrival_s - before > 1.5 * kFramePeriod;
    EXPECT_EQ(frame->suspect, after_gap);
    before = frame->arrival_s;
    suspect += frame->suspect ? 1 : 0;
  }
  EXPECT_GE(suspect, truth.torn);
}

TEST(TactileBoard, UnpluggingIsATypedErrorAfterTheLastFrame) {
  SimulatedRig rig(running_rig());
  TactileBoard board(rig.board_port());
  rig.run_for(0.1);
  rig.unplug_board();
  std::uint64_t frames = 0;
  EXPECT_THROW(
      {
        while (board.next(kPatience)) ++frames;
      },
      PortUnplugged);
  EXPECT_EQ(frames, rig.world().board().counters().sent);
}

TEST(TactileBoard, OverAPseudoTerminalAtTenTimesTheSpeed) {
  const TemporaryFolder folder;
  PtyRig rig(running_rig(), folder / "board", folder / "printer", 10);
  TactileBoard board(std::make_unique<SerialPort>(folder / "board", SerialSettings{kBoardBaud, 10}));
  std::uint64_t frames = 0;
  const double until = monotonic_seconds() + kPatience;
  while (frames < 3000 && monotonic_seconds() < until) frames += board.next(1) ? 1 : 0;
  EXPECT_EQ(frames, 3000U);
  EXPECT_GT(monotonic_seconds(), until - kPatience + 0.2) << "the board does not keep its rate";
  rig.unplug_board();
  EXPECT_THROW(
      {
        while (board.next(kPatience)) continue;
      },
      PortUnplugged);
}

TEST(TactileBoard, APrinterAtTheBoardsPortIsRecognised) {
  const TemporaryFolder folder;
  RigSettings settings;
  settings.printer.boot_s = 0.01;
  settings.printer.heartbeat = true;
  PtyRig rig(settings, folder / "board", folder / "printer", 20);
  TactileBoard board(std::make_unique<SerialPort>(folder / "printer", SerialSettings{kBoardBaud, 20}),
                     {.silence_s = 10});
  EXPECT_THROW((void)board.next(kPatience), WrongDevice);
}

TEST(TactileBoard, ABoardAtThePrintersPortIsRecognised) {
  const TemporaryFolder folder;
  PtyRig rig(running_rig(), folder / "board", folder / "printer", 5);
  SerialPort port(folder / "board", {.speedup = 5});
  MarlinLink link(port);
  EXPECT_THROW(link.connect(), WrongDevice);
}

}  // namespace
}  // namespace supertac
