#include "hardware/collection/collection.h"

#include <atomic>
#include <chrono>
#include <thread>

#include "hardware/collection/palpation_recorder.h"
#include "hardware/ports/serial_port.h"
#include "tests/hardware/rig_support.h"
#include "tests/support/test.h"

namespace supertac::collection_test {

/// A collection on the simulated rig. Where its frames stand is compared with the truth in
/// fault_run_test.cpp.
struct CollectionBench {
  explicit CollectionBench(const RigSettings& rig_settings) : rig(rig_settings) {
    settings.journal = folder / "journal";
    settings.header = "test";
    settings.reader.queue_frames = 16;  // nobody looks at the live frames here
  }
  RecorderReport record() { return record_palpation(rig.board_port(), rig.printer_port(), settings); }

  TemporaryFolder folder;
  SimulatedRig rig;
  RecorderSettings settings;
};

TEST(Collection, NothingMovesBeforeTheBoardIsHeard) {
  CollectionBench bench(running_rig({}, {.lost_frame_rate = 1}));
  EXPECT_ERROR(bench.record(), BoardSilent,
               "expected 1008 frames/s, found none for 1.0 s; is this the board's port (supertac-check "
               "machine)? If it is, "
               "plug the board out and in again");
  EXPECT_TRUE(moves_of(bench.rig.world().printer()).empty());
  EXPECT_EQ(bench.folder.entries(), 0U) << "a journal of nothing was left behind";
}

TEST(Collection, ASpeedIsNamedByThreeDigits) {
  for (const double named : {0.301, 10.2, 14.3, 30.2, 149.0, 1230.0})
    EXPECT_EQ(named_speed(named * 1.0001, 10), named);
  EXPECT_EQ(named_speed(10.04, 10), 10);
}

TEST(Collection, WhatWasSetIsPutBackWhereverTheRunEnds) {
  for (const bool stopped : {false, true}) {
    CollectionBench bench(running_rig({.left_over = {.speed_percent = 150}}));
    if (!stopped) bench.rig.unplug_board();
    // While the board is waited for: the state is set, and nothing has moved.
    bench.settings.stop = [&] {
      return stopped && bench.rig.world().printer().left_over().speed_percent == 100;
    };
    EXPECT_ANY_THROW(bench.record());
    EXPECT_EQ(bench.rig.world().printer().left_over().speed_percent, 150);
    EXPECT_TRUE(moves_of(bench.rig.world().printer()).empty());
  }
}

using Finger = PalpationOutcome::Finger;

// A plug that is pulled, through the kernel's pseudo-terminals: a typed error, and where the finger is left.
enum class Plug { board, printer };

void sleep_for(double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }

// One pass over 20 mm that starts just above the plate; the plug is pulled at a random moment of it. With the
// printer still there the finger ends lifted, without it the note says to lift it by hand.
TEST(UnplugRun, ACollectionEndsWithATypedErrorAndTheFingerUp) {
  constexpr double kRunSeconds = 5.5;
  constexpr Point3 kOrigin{99.7, 101.17, 97.81};
  for (const Plug plug : {Plug::board, Plug::printer}) {
    const TemporaryFolder folder;
    FaultyPtyRig rig(running_rig({.head = kOrigin}), folder / "board", folder / "printer");
    RecorderSettings settings;
    settings.bed.plan.passes = 1;
    settings.bed.plan.slide = 20;
    settings.bed.origin = kOrigin;
    settings.journal = folder / "journal";
    settings.header = "unplug run";
    std::atomic<bool> ended{false};
    std::thread puller([&] {
      for (bool moves = false; !moves && !ended; sleep_for(1e-3))
        rig.with_world([&](RigWorld& world) { moves = world.printer().moving(world.now()); });
      sleep_for(kRunSeconds * RandomStream(1, 2).uniform(0));
      plug == Plug::board ? rig.unplug_board() : rig.unplug_printer();
    });
    const PalpationOutcome outcome =
        record_palpation(std::make_unique<SerialPort>(folder / "board", SerialSettings{rig::kBoardBaud}),
                         std::make_unique<SerialPort>(folder / "printer", SerialSettings{115200}), settings)
            .outcome;
    ended = true;
    puller.join();
    Point3 head;
    rig.with_world([&](RigWorld& world) { head = world.printer().head(world.now()); });
    ASSERT_FALSE(outcome.complete);
    EXPECT_THROW(std::rethrow_exception(outcome.error), PortUnplugged);
    const bool up = head.z > settings.bed.plan.start.z + 4.9;
    if (plug == Plug::board)
      EXPECT_TRUE(up && outcome.finger == Finger::lifted) << outcome.note;
    else
      EXPECT_TRUE(up || outcome.note.find("by hand") != std::string::npos) << outcome.note;
  }
}

}  // namespace supertac::collection_test
