// Collections on a simulated rig, and what becomes of them when a call on the journal's file fails. Where
// their frames stand is compared with the truth in fault_run_test.cpp.
#include "hardware/collection/collection.h"

#include <chrono>
#include <thread>

#include "hardware/ports/errors.h"
#include "tests/hardware/rig_support.h"
#include "tests/io/faults.h"
#include "tests/support/test.h"

namespace supertac::collection_test {

TEST(Collection, NothingMovesBeforeTheBoardIsHeard) {
  CollectionBench bench(running_rig({}, {.lost_frame_rate = 1}));
  EXPECT_ERROR(bench.record(), BoardSilent,
               "expected 1008 frames/s, found none for 1.0 s; is this the board's port (supertac-check "
               "machine)? If it is, "
               "plug the board out and in again");
  EXPECT_TRUE(moves_of(bench.firmware()).empty());
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
    bench.settings.stop = [&] { return stopped && bench.firmware().left_over().speed_percent == 100; };
    EXPECT_ANY_THROW(bench.record());
    EXPECT_EQ(bench.firmware().left_over().speed_percent, 150);
    EXPECT_TRUE(moves_of(bench.firmware()).empty());
  }
}

constexpr Point3 kLowAt{99.7, 101.17, 97.81};

/// One short collection whose journal meets a fault.
struct FaultyCollection : CollectionBench {
  FaultyCollection() : CollectionBench(running_rig({.head = kLowAt}), {.passes = 1, .slide = 2}, kLowAt) {
    // Simulated time would otherwise run away from the journal's thread, which would then write all at once.
    settings.progress = [](const Leg&, const Point3&, const ReaderCounters&) {
      std::this_thread::sleep_for(std::chrono::microseconds(50));
    };
  }
  /// What was promised and does not hold; empty when all does. Says in `failed` whether the run ended in an
  /// error.
  std::string run(bool& failed) {
    failed = true;
    try {
      const PalpationOutcome outcome = record().outcome;
      failed = !outcome.complete;
      if (failed) std::rethrow_exception(outcome.error);
    } catch (const JournalError&) {
    } catch (const std::exception& error) {
      return std::string("expected JournalError, found: ") + error.what();
    }
    const double z = head().z;
    if (z < settings.bed.plan.start.z + settings.bed.plan.lift - 0.01)
      return "the finger is at Z" + std::to_string(z);
    return {};
  }
  /// The same of its files; to be asked when the calls work again.
  std::string left_behind() const {
    for (const auto& entry : std::filesystem::directory_iterator(folder.path())) {
      if (entry.path() != settings.journal) return "left behind: " + entry.path().string();
      try {
        (void)collection_of(journal());
      } catch (const JournalError& error) {
        return error.what();
      }
    }
    return {};
  }
};

// The journal's first calls: its open, two writes of its header; then open, fsync and close of its folder,
// through which nothing was written: that close can lose nothing.
constexpr int kCloseOfFolder = 6;

struct Sweep {
  int runs = 0, failed = 0;
};

Sweep sweep(int error, bool forever) {
  Sweep sweep;
  int untouched = 0;  // the number of calls differs a little from run to run
  for (int at = 1; at < 2000; ++at) {
    FaultyCollection collection;
    bool failed = false, reached = false;
    std::string broken;
    {
      const FaultInjection injection(at, error, forever);
      broken = collection.run(failed);
      reached = FaultInjection::reached();
    }
    if (broken.empty()) broken = collection.left_behind();
    EXPECT_EQ(broken, "") << "call " << at << " fails with " << error << (forever ? " for ever" : " once");
    untouched = reached ? 0 : untouched + 1;
    if (untouched == 5) return sweep;
    if (!reached) continue;
    EXPECT_EQ(failed, forever || at != kCloseOfFolder) << "call " << at;
    ++sweep.runs;
    sweep.failed += failed ? 1 : 0;
  }
  ADD_FAILURE() << "the run never ends";
  return sweep;
}

TEST(CollectionFaults, EveryCallOnceOnABrokenDisk) { EXPECT_GT(sweep(EIO, false).failed, 20); }

TEST(CollectionFaults, EveryCallAndAllThatFollowOnAFullDisk) { EXPECT_GT(sweep(ENOSPC, true).failed, 20); }

TEST(CollectionFaults, ShortWritesAreCompleted) {
  FaultyCollection collection;
  bool failed = true;
  {
    const FaultInjection injection(1, 0, true, Fault::short_count);
    EXPECT_EQ(collection.run(failed), "");
  }
  EXPECT_EQ(collection.left_behind(), "");
  EXPECT_FALSE(failed);
}

}  // namespace supertac::collection_test
