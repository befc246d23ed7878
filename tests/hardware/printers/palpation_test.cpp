#include "hardware/printers/palpation.h"

#include "tests/hardware/rig_support.h"
#include "tests/support/test.h"

namespace supertac::palpation_test {

using rig::kMounted;

struct PalpationBench : PrinterBench {
  explicit PalpationBench(const RigSettings& settings = running_rig()) : PrinterBench(settings) {
    printer.confirm_origin(kMounted);
  }
  PalpationOutcome run(PalpationPlan plan, PalpationObserver observer = {}) {
    return Palpation(printer, plan, std::move(observer)).run();
  }
  /// Does `plant` once, when the head is in the slide of pass 1.
  PalpationObserver in_slide(std::function<void()> plant) {
    PalpationObserver observer;
    auto done = std::make_shared<bool>(false);
    observer.position = [=](const Leg& leg, const PositionSample& sample) {
      if (leg.phase != Phase::slide || sample.position.y < 120 || *done) return;
      *done = true;
      plant();
    };
    return observer;
  }
};

TEST(Palpation, EightPassesLiftBeforeTheyShift) {
  PalpationBench bench;
  std::vector<std::string> phases;
  PalpationObserver observer;
  observer.leg_ended = [&](const Leg& leg) { phases.emplace_back(name_of(leg.phase)); };
  const PalpationOutcome outcome = bench.run({.passes = 2}, observer);
  EXPECT_TRUE(outcome.complete);
  EXPECT_EQ(outcome.passes_done, 2);
  EXPECT_EQ(phases, (std::vector<std::string>{"approach", "onset", "slide", "release", "reposition", "onset",
                                              "slide", "release", "reposition", "reposition"}));
  EXPECT_LT(distance(bench.head(), kMounted), 1e-6) << "the next run confirms the same origin";
}

// From 131.81 mm down to 96.81 at 5 mm/s takes 7 s, onset and release 1 s each, the slide 10.8 s, the way to
// the next pass, and back to the origin, 2.1623 s.
TEST(Palpation, TheTimeLeftIsThatOfTheLegsToCome) {
  const std::vector<Leg> legs = legs_of({.passes = 2}, kMounted);
  EXPECT_NEAR(seconds_left(legs, legs[0], legs[0].from), 43.9246, 1e-3);
  EXPECT_NEAR(seconds_left(legs, legs[6], between(legs[6].from, legs[6].to, 0.5)), 15.5623, 1e-3);
  EXPECT_NEAR(seconds_left(legs, legs[8], legs[8].from), 9.1623, 1e-3) << "upwards, behind the last pass";
  // Short moves in the air, of a printer without M114 R; and the way back to where a printer has homed.
  const Leg measured{1, Phase::approach, legs[1].from, {99.7, 103.17, 96.81}, 10};
  EXPECT_NEAR(seconds_left(legs, measured, measured.from), 0.2 + 36.9246, 1e-3);
  EXPECT_NEAR(seconds_left(legs, {2, Phase::reposition, {0, 0, 100}, {0, 0, 150}, 5}, {0, 0, 120}), 6, 1e-9);
}

TEST(Palpation, TheWholeWayIsCheckedBeforeTheFirstMove) {
  PalpationBench bench;
  EXPECT_ERROR(bench.run({.passes = 40}), OutsideLimits,
               "beside the plate; nothing was sent, lift first");  // only the last passes leave the plate
  EXPECT_ERROR(bench.run({.passes = 0}), std::invalid_argument, "expected 1 to 1000 passes");
  EXPECT_ERROR(bench.run({.speed = INFINITY}), std::invalid_argument, "slide, lift and speed above 0");
  EXPECT_TRUE(moves_of(bench.firmware()).empty());
}

TEST(Palpation, AFaultInContactLiftsTheFingerWhateverIsThrown) {
  const std::vector<std::function<void()>> throwers = {
      [] { throw BoardSilent("board: no frames"); },
      [] { throw JournalError("journal: cannot be written: No space left on device"); },
      [] { throw OperatorStop("stopped"); },
      [] { throw std::bad_alloc(); },
      [] { throw 42; },
      [] { throw PortUnplugged("port simulated printer2: the device is gone"); }};
  for (const auto& thrower : throwers) {
    PalpationBench bench;
    const PalpationOutcome outcome = bench.run({.passes = 2}, bench.in_slide(thrower));
    EXPECT_FALSE(outcome.complete);
    EXPECT_EQ(outcome.finger, PalpationOutcome::Finger::lifted) << outcome.note;
    EXPECT_TRUE(outcome.error);
    EXPECT_GT(bench.head().z, 96);
    EXPECT_LT(bench.head().y, 130) << "it went on sliding";
  }
}

TEST(Palpation, AResetInTheSlideEndsTheRunAtOnce) {
  PalpationBench bench;
  const PalpationOutcome outcome =
      bench.run({.passes = 2}, bench.in_slide([&] { bench.firmware().reset(bench.rig.now()); }));
  EXPECT_FALSE(outcome.complete);
  EXPECT_EQ(outcome.finger, PalpationOutcome::Finger::stopped);
  EXPECT_THROW(std::rethrow_exception(outcome.error), PrinterReset);
  EXPECT_LT(bench.head().y, 125);
  EXPECT_LT(bench.head().z, 92) << "something was sent after the reset";
}

TEST(Palpation, UnpluggingThePrinterSaysThatTheFingerMayBeInContact) {
  PalpationBench bench;
  const PalpationOutcome outcome =
      bench.run({.passes = 1}, bench.in_slide([&] { bench.rig.unplug_printer(); }));
  EXPECT_THROW(std::rethrow_exception(outcome.error), PortUnplugged);
  EXPECT_EQ(outcome.finger, PalpationOutcome::Finger::unknown);
  EXPECT_NE(outcome.note.find("by hand"), std::string::npos);
}

TEST(Palpation, FirmwareWithoutRealtimePositionIsRecognised) {
  PalpationBench bench(running_rig({.realtime_position = false}));
  const PalpationOutcome outcome = bench.run({.passes = 1});
  EXPECT_TRUE(outcome.complete);
  EXPECT_FALSE(outcome.realtime_position);
}

TEST(Palpation, TheStartDelayIsSeenInThePositions) {
  PalpationBench bench;
  double first_motion = 0;
  PalpationObserver observer;
  observer.position = [&](const Leg& leg, const PositionSample& sample) {
    const bool moved = leg.phase == Phase::slide && sample.position.y > leg.from.y + 0.05;
    if (moved && first_motion == 0) first_motion = sample.time_s - leg.accepted_s;
  };
  bench.run({.passes = 1}, observer);
  EXPECT_NEAR(first_motion, 0.135, 0.02);
}

}  // namespace supertac::palpation_test
