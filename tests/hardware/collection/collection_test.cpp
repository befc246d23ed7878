#include "hardware/collection/collection.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "hardware/collection/capture.h"
#include "hardware/collection/palpation_recorder.h"
#include "hardware/ports/errors.h"
#include "tests/expect_error.h"
#include "tests/hardware/rig_support.h"

namespace supertac {
namespace {

struct TruthOfFrame {
  double middle_s;
  Point3 head;
  bool sent;
};

double onset_of(const Journal& journal, int pass) {
  for (const JournalRecord& record : journal.of(Stream::event)) {
    if (record.text().starts_with("leg 0 " + std::to_string(pass) + " 1 ")) return record.time_s;
  }
  return 0;
}

/// A collection on the simulated rig, with the truth about every frame.
struct CollectionBench {
  explicit CollectionBench(const RigSettings& rig_settings) : rig(rig_settings) {
    settings.journal = folder / "journal";
    settings.header = "test";
    settings.board.queue_frames = 16;  // nobody looks at the live frames here
    rig.world().board().on_frame([this](std::uint64_t, double middle, const Point3& head, bool sent) {
      truth.push_back({middle, head, sent});
    });
  }
  RecorderReport record() { return record_palpation(rig.board_port(), rig.printer_port(), settings); }
  Collection collect() { return collection_of(read_journal(settings.journal)); }

  /// RMS of the distance (mm) between a frame's position and where the head was in its middle, over the
  /// frames of a pass whose truth `counts`; frames and truth are matched by time. `frames` says how many they
  /// were.
  double position_error(const CollectedPass& pass, double begin,
                        const std::function<bool(const TruthOfFrame&)>& counts, std::size_t& frames) const {
    double squares = 0;
    std::size_t at = 0;
    frames = 0;
    for (std::size_t i = 0; i < pass.time_s.size(); ++i) {
      const double time = begin + pass.time_s[i];
      while (at + 1 < truth.size() &&
             std::abs(truth[at + 1].middle_s - time) < std::abs(truth[at].middle_s - time)) {
        ++at;
      }
      if (!counts(truth[at])) continue;
      ++frames;
      const double* p = pass.position.data() + 3 * i;
      squares += std::pow(distance(truth[at].head, {p[0], p[1], p[2]}), 2);
    }
    return std::sqrt(squares / static_cast<double>(frames));
  }
  /// The same over the whole pass, over its slide while the head moves, and over half a second around the
  /// slide's start, where the delay of the firmware and the acceleration are.
  void expect_good_positions(const Collection& collection) {
    const Journal journal = read_journal(settings.journal);
    for (const CollectedPass& pass : collection.passes) {
      const double begin = onset_of(journal, pass.pass), low = settings.bed.plan.start.y;
      const auto slides = [&](const TruthOfFrame& t) {
        return t.head.y > low && t.head.y < low + settings.bed.plan.slide;
      };
      double start = 0;
      for (const TruthOfFrame& t : truth) {
        if (start == 0 && t.middle_s > begin && slides(t)) start = t.middle_s;
      }
      const auto expect_within = [&](const char* what, const std::function<bool(const TruthOfFrame&)>& counts,
                                     std::size_t at_least) {
        std::size_t frames = 0;
        const double error = position_error(pass, begin, counts, frames);
        testing::Test::RecordProperty(what + std::to_string(pass.pass) + "_mm", std::to_string(error));
        EXPECT_LE(error, 0.05) << what << " of pass " << pass.pass;
        EXPECT_GT(frames, at_least) << what << " of pass " << pass.pass;
      };
      expect_within(
          "whole", [](const TruthOfFrame&) { return true; }, 9000);
      expect_within("slide", slides, 9000);
      expect_within(
          "start", [&](const TruthOfFrame& t) { return std::abs(t.middle_s - start) < 0.25; }, 400);
    }
  }

  TemporaryFolder folder;
  SimulatedRig rig;
  RecorderSettings settings;
  std::vector<TruthOfFrame> truth;
};

TEST(Collection, EveryFrameHasAPositionWithinFiveHundredths) {
  RigSettings rig = running_rig();
  rig.faults.lost_frame_rate = 0.01;
  CollectionBench bench(rig);
  bench.settings.bed.plan.passes = 2;
  const RecorderReport report = bench.record();
  ASSERT_TRUE(report.outcome.complete);
  const Collection collection = bench.collect();
  EXPECT_TRUE(collection.complete);
  ASSERT_EQ(collection.passes.size(), 2U);
  for (const CollectedPass& pass : collection.passes) EXPECT_TRUE(pass.complete);
  bench.expect_good_positions(collection);
}

TEST(Collection, WithoutRealtimePositionsTheMotionIsModelled) {
  RigSettings rig = running_rig();
  rig.printer.realtime_position = false;
  CollectionBench bench(rig);
  bench.settings.bed.plan.passes = 1;
  ASSERT_TRUE(bench.record().outcome.complete);
  const Collection collection = bench.collect();
  ASSERT_EQ(collection.passes.size(), 1U);
  bench.expect_good_positions(collection);
}

TEST(Collection, EveryFrameIsAccountedFor) {
  RigSettings rig = running_rig();
  rig.faults.lost_frame_rate = 0.02;
  rig.faults.stall_rate = 0.0005;
  CollectionBench bench(rig);
  bench.settings.bed.plan.passes = 1;
  ASSERT_TRUE(bench.record().outcome.complete);
  const Collection collection = bench.collect();
  std::uint64_t between = 0;  // lost between the first and the last frame that arrived
  std::uint64_t run = 0;
  bool begun = false;
  for (const TruthOfFrame& frame : bench.truth) {
    if (frame.sent && begun) between += run;
    if (frame.sent) run = 0;
    begun = begun || frame.sent;
    if (!frame.sent) ++run;
  }
  // Frames made before the board was opened are nobody's: count what the board sent afterwards.
  EXPECT_EQ(collection.decoder.discarded_bytes, 0U);
  EXPECT_NEAR(static_cast<double>(collection.missing) / static_cast<double>(between), 1, 0.05);
  EXPECT_GT(collection.missing, 200U);
}

TEST(Collection, AReplayGivesTheSameFramesAndTheSameRun) {
  RigSettings rig = running_rig();
  rig.faults = {.byte_rate = 0.001, .lost_frame_rate = 0.01};
  CollectionBench bench(rig);
  bench.settings.bed.plan.passes = 1;
  const RecorderReport first = bench.record();
  const Journal journal = read_journal(bench.settings.journal);

  RecorderSettings again = bench.settings;
  again.journal = bench.folder / "replayed";
  again.replay = true;
  const RecorderReport second =
      record_palpation(std::make_unique<ReplayPort>(journal.of(Stream::board), "board"),
                       std::make_unique<ReplayPort>(journal.of(Stream::printer), "printer"), again);
  EXPECT_EQ(second.outcome.complete, first.outcome.complete);
  EXPECT_EQ(second.printer.repeats, first.printer.repeats);
  const Collection a = collection_of(journal), b = collection_of(read_journal(again.journal));
  ASSERT_EQ(a.passes.size(), b.passes.size());
  EXPECT_EQ(a.passes[0].time_s, b.passes[0].time_s);
  EXPECT_EQ(a.passes[0].volts, b.passes[0].volts);
  EXPECT_EQ(a.passes[0].position, b.passes[0].position);
  EXPECT_GT(a.passes[0].time_s.size(), 9000U);
}

TEST(Collection, AReplayWithAnotherPlanIsRefused) {
  CollectionBench bench(running_rig());
  bench.settings.bed.plan.passes = 1;
  bench.record();
  const Journal journal = read_journal(bench.settings.journal);
  RecorderSettings again = bench.settings;
  again.journal = bench.folder / "replayed";
  again.replay = true;
  again.bed.plan.speed = 5;
  const RecorderReport second =
      record_palpation(std::make_unique<ReplayPort>(journal.of(Stream::board), "board"),
                       std::make_unique<ReplayPort>(journal.of(Stream::printer), "printer"), again);
  EXPECT_FALSE(second.outcome.complete);
}

TEST(Collection, NothingMovesBeforeTheBoardIsHeard) {
  RigSettings rig = running_rig();
  rig.faults.lost_frame_rate = 1;
  CollectionBench bench(rig);
  EXPECT_ERROR(
      bench.record(), BoardSilent,
      "expected 1008 frames/s, found none for 1.0 s; is this the board's port (--list-ports)? If it is, "
      "plug the board out and in again");
  EXPECT_TRUE(moves_of(bench.rig.world().printer()).empty());
  EXPECT_EQ(bench.folder.entries(), 0U) << "a journal of nothing was left behind";
}

TEST(Collection, ABoardThatGoesAwayInContactEndsWithTheFingerUp) {
  CollectionBench bench(running_rig());
  bench.settings.bed.plan.passes = 2;
  bench.settings.progress = [&](const Leg& leg, const Point3& at, const BoardCounters&) {
    if (leg.phase == Phase::slide && at.y > 120) bench.rig.unplug_board();
  };
  const RecorderReport report = bench.record();
  EXPECT_FALSE(report.outcome.complete);
  EXPECT_EQ(report.outcome.finger, PalpationOutcome::Finger::lifted);
  EXPECT_ERROR(std::rethrow_exception(report.outcome.error), PortUnplugged,
               "check the cable and start again");
  EXPECT_GT(bench.rig.world().printer().head(bench.rig.now()).z, 96);
  const Collection kept = bench.collect();
  EXPECT_FALSE(kept.complete);
  ASSERT_EQ(kept.passes.size(), 1U);
  EXPECT_FALSE(kept.passes[0].complete);
  EXPECT_GT(kept.passes[0].time_s.size(), 1000U);
}

TEST(Collection, TheOperatorsStopLiftsTheFinger) {
  CollectionBench bench(running_rig());
  std::atomic<bool> stop{false};
  bench.settings.stop = [&stop] { return stop.load(); };
  bench.settings.progress = [&](const Leg& leg, const Point3& at, const BoardCounters&) {
    if (leg.phase == Phase::slide && at.y > 120) stop = true;
  };
  const RecorderReport report = bench.record();
  EXPECT_ERROR(std::rethrow_exception(report.outcome.error), OperatorStop, "stopped by the operator");
  EXPECT_EQ(report.outcome.finger, PalpationOutcome::Finger::lifted);
  EXPECT_LT(bench.rig.world().printer().head(bench.rig.now()).y, 130);
}

}  // namespace
}  // namespace supertac
