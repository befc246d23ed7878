#include "hardware/collection/collection.h"

#include "hardware/collection/palpation_recorder.h"
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

}  // namespace supertac::collection_test
