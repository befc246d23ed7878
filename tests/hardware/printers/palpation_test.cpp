#include "hardware/printers/palpation.h"

#include <nlohmann/json.hpp>

#include "io/files/file.h"
#include "tests/hardware/rig_support.h"
#include "tests/support/test.h"

namespace supertac::palpation_test {

using rig::kMounted;

TEST(Palpation, EightPassesLiftBeforeTheyShift) {
  ReadyBench bench;
  std::vector<std::string> phases;
  PalpationObserver observer;
  observer.leg_ended = [&](const Leg& leg) { phases.emplace_back(name_of(leg.phase)); };
  const PalpationOutcome outcome = run_palpation(bench.printer, {.passes = 2}, observer);
  EXPECT_TRUE(outcome.complete);
  EXPECT_EQ(outcome.passes_done, 2);
  EXPECT_EQ(phases, (std::vector<std::string>{"approach", "onset", "slide", "release", "reposition", "onset",
                                              "slide", "release", "reposition", "reposition"}));
  EXPECT_LT(distance(bench.head(), kMounted), 1e-6) << "the next run confirms the same origin";
}

// From 131.81 mm down to 96.81 at 5 mm/s takes 7 s, onset and release 1 s each, the slide 10.8 s, the way to
// the next pass, and back to the origin, 2.1623 s.
TEST(Palpation, TheTimeLeftIsThatOfTheLegsToCome) {
  const std::vector<Leg> legs = legs_within({}, {.passes = 2}, kMounted);
  EXPECT_NEAR(seconds_left(legs[0], legs[0].from), 43.9246, 1e-3);
  EXPECT_NEAR(seconds_left(legs[6], between(legs[6].from, legs[6].to, 0.5)), 15.5623, 1e-3);
  EXPECT_NEAR(seconds_left(legs[8], legs[8].from), 9.1623, 1e-3) << "upwards, behind the last pass";
}

TEST(Palpation, TheWholeWayIsCheckedBeforeTheFirstMove) {
  ReadyBench bench;
  EXPECT_ERROR(run_palpation(bench.printer, {.passes = 40}), OutsideLimits,
               "beside the plate; nothing was sent, lift first");  // only the last passes leave the plate
  EXPECT_REFUSAL(
      "palpation: plan expects 1 to 1000 passes, and slide, lift and speed above 0, got 0 passes, a slide of "
      "108 mm, a lift of 5 mm and 10 mm/s",
      run_palpation(bench.printer, {.passes = 0}));
  EXPECT_ERROR(run_palpation(bench.printer, {.speed = INFINITY}), std::invalid_argument,
               "slide, lift and speed above 0");
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
    ReadyBench bench;
    const PalpationOutcome outcome = bench.run({.passes = 2}, thrower);
    EXPECT_FALSE(outcome.complete);
    EXPECT_EQ(outcome.finger, PalpationOutcome::Finger::lifted) << outcome.note;
    EXPECT_TRUE(outcome.error);
    EXPECT_GT(bench.head().z, 96);
    EXPECT_LT(bench.head().y, 130) << "it went on sliding";
  }
}

TEST(Palpation, AResetInTheSlideEndsTheRunAtOnce) {
  ReadyBench bench;
  const PalpationOutcome outcome = bench.run({.passes = 2}, [&] { bench.firmware().reset(bench.rig.now()); });
  EXPECT_FALSE(outcome.complete);
  EXPECT_EQ(outcome.finger, PalpationOutcome::Finger::stopped);
  EXPECT_THROW(std::rethrow_exception(outcome.error), PrinterReset);
  EXPECT_LT(bench.head().y, 125);
  EXPECT_LT(bench.head().z, 92) << "something was sent after the reset";
}

TEST(Palpation, UnpluggingThePrinterSaysThatTheFingerMayBeInContact) {
  ReadyBench bench;
  const PalpationOutcome outcome = bench.run({.passes = 1}, [&] { bench.rig.unplug_printer(); });
  EXPECT_THROW(std::rethrow_exception(outcome.error), PortUnplugged);
  EXPECT_EQ(outcome.finger, PalpationOutcome::Finger::unknown);
  EXPECT_NE(outcome.note.find("by hand"), std::string::npos);
}

constexpr const char* kLeast = R"({"plate": [60, 40, 30], "origin": [60, 40, 70], "high": [180, 180, 180]})";

TEST(Bed, WhatAFileLeavesOutIsAsOnTheRig) {
  const Bed bed = bed_of_json(kLeast, "b.json");
  EXPECT_EQ(bed.origin, (Point3{60, 40, 70}));
  EXPECT_EQ(bed.limits.plate, (Point3{60, 40, 30}));
  EXPECT_EQ(bed.limits.high, (Point3{180, 180, 180}));
  EXPECT_EQ(bed.plan.start, (Point3{60.5, 40, 30}));
  Bed rest = bed;
  rest.origin = Bed{}.origin, rest.limits = Bed{}.limits, rest.plan.start = Bed{}.plan.start;
  EXPECT_EQ(rest, Bed{});
  EXPECT_NO_THROW(legs_within(bed.limits, bed.plan, bed.origin));
}

TEST(Bed, WhatIsWrittenIsReadAgain) {
  Bed bed = bed_of_json(kLeast, "b.json");
  bed.limits.low = {-1.5, -2, 0.25};
  bed.plan.start.x = 63;
  bed.plan.shift_x = -2.5, bed.plan.passes = 3, bed.plan.slide = 80.1, bed.plan.lift = 7,
  bed.plan.speed = 4.5;
  bed.baud = 250'000;
  EXPECT_EQ(bed_of_json(json_of(bed).dump(), "again"), bed);
  EXPECT_EQ(bed_of_json(json_of(Bed{}).dump(), "rig"), Bed{});
}

TEST(Bed, AMessageNamesTheKey) {
  const auto with = [](const std::string& more) {
    std::string text = kLeast;
    return bed_of_json(text.insert(1, more + ", "), "b.json");
  };
  EXPECT_ERROR(bed_of_json("{}", "b.json"), FileError,
               "\"plate\" must be three numbers of mm within 10000, [x, y, z] of the printer, found []");
  EXPECT_ERROR(with(R"("low": [0, 0])"), FileError, "\"low\" must be three numbers");
  EXPECT_ERROR(with(R"("low": [])"), FileError, "\"low\" must be three numbers");
  EXPECT_ERROR(with(R"("low": [0, 0, 1e9])"), FileError, "\"low\" must be three numbers");
  EXPECT_ERROR(with(R"("low": 3)"), FileError, "\"low\" must be a list of numbers, found 3");
  EXPECT_ERROR(with(R"("speed_mm_s": 51)"), FileError, "\"speed_mm_s\" must be 0.5 to 50, found 51");
  EXPECT_ERROR(with(R"("slide_mm": 109)"), FileError, "\"slide_mm\" must be 1 to 108, found 109");
  EXPECT_ERROR(with(R"("passes": 2.5)"), FileError, "\"passes\" must be a whole number, found 2.5");
  EXPECT_ERROR(with(R"("baud": 9)"), FileError, "\"baud\" must be 50 to 1000000, found 9");
  for (const char* baud : {"1e5", "1000001"})
    EXPECT_ERROR(with(R"("baud": )" + std::string(baud)), FileError, "\"baud\" must be a whole number");
  EXPECT_EQ(with(R"("baud": 1000000)").baud, 1'000'000U);
  EXPECT_ERROR(with(R"("sped": 9)"), FileError, "knows no key 'sped'; it may have plate, origin");
  EXPECT_ERROR(bed_of_json("[", "b.json"), FileError, "b.json");
}

// Beside this plate the head is as free, and over it as low, as beside and over the rig's.
TEST(Bed, TheLimitsMoveWithThePlate) {
  const Limits here, there{.low = {-500, -500, -100}, .high = {900, 900, 900}, .plate = {300.2, 1.17, -8.19}};
  EXPECT_DOUBLE_EQ(here.clearance_z(), 95);
  EXPECT_DOUBLE_EQ(there.clearance_z(), -5);
  const auto allowed = [](const Limits& limits, double x, double y, double z) {
    try {
      limits.check_path({x, y, z}, {x, y, z});
      return true;
    } catch (const std::exception&) {
      return false;
    }
  };
  for (const double x : {96.99, 97.01, 138.49, 138.51})
    for (const double y : {98.99, 99.01, 211.49, 211.51})
      for (const double z : {94.9, 95.1}) {
        const bool free = z > 95 || (x > 97 && x < 138.5 && y > 99 && y < 211.5);
        EXPECT_EQ(allowed(here, x, y, z), free) << x << " " << y << " " << z;
        EXPECT_EQ(allowed(there, x + 201, y - 100, z - 100), free) << x << " " << y << " " << z;
      }
}

TEST(Bed, TheExampleIsRead) {
  const Bed bed = read_bed(SUPERTAC_SOURCE "/examples/beds/mini_printer.json");
  EXPECT_NO_THROW(legs_within(bed.limits, bed.plan, bed.origin));
}

}  // namespace supertac::palpation_test
