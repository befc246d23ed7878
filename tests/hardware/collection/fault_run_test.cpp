// Collections on a rig, a board or a host that stands still for a while, and with every other fault: each
// recording is right, or says that it is not. Frames are compared with the truth by the number they carry.

#include "tests/hardware/fault_run.h"
#include "hardware/collection/collection.h"
#include "io/numbers/numbers.h"
#include "tests/hardware/fake_sensor.h"
#include "tests/support/test.h"

namespace supertac::fault_run_test {

constexpr Point3 kLow{99.7, 101.17, 99.81};  // three millimetres above the finger's height between passes

FaultVerdict slide(const RigSettings& rig, double speed) {
  return run_faulty_collection(rig, {.passes = 1, .slide = 40, .speed = speed}, kLow);
}

void expect_right(const FaultVerdict& verdict, double worst_mm, const std::string& what) {
  EXPECT_EQ(verdict.doubt + verdict.broken + verdict.error, "") << what;
  EXPECT_LT(verdict.worst_mm, worst_mm) << what;
}

TEST(Stalls, WithoutAnyAllIsTrusted) {
  for (const bool realtime : {true, false}) {
    for (const double speed : {5.0, 10.0, 30.0}) {
      const FaultVerdict good = slide(running_rig({.realtime_position = realtime}), speed);
      expect_right(good, 0.05, (realtime ? "M114 R, " : "") + format(speed) + " mm/s");
      EXPECT_EQ(good.realtime, realtime);
      EXPECT_EQ(good.left_out, 0U);
    }
  }
}

// All frames of two passes, a hundredth of which never arrives.
TEST(Stalls, LostFramesAreCountedAndCostNoPosition) {
  for (const bool realtime : {true, false}) {
    const FaultVerdict lossy = run_faulty_collection(
        running_rig({.realtime_position = realtime}, {.lost_frame_rate = 0.01}), {.passes = 2});
    expect_right(lossy, 0.05, realtime ? "M114 R" : "");
    EXPECT_GT(lossy.compared, 2 * 9000U);
    EXPECT_GT(lossy.missing, 200U);
  }
  const RigSettings stalled = running_rig({}, {.stall_rate = 0.0005, .lost_frame_rate = 0.02});
  EXPECT_EQ(run_faulty_collection(stalled, {.passes = 1}).broken, "");
}

// Whatever the delay of a firmware, it is measured: no number of another machine decides.
TEST(Stalls, WithoutM114RTheStartIsMeasured) {
  for (const double delay_s : {0.02, 0.05, 0.2, 0.4})
    expect_right(slide(running_rig({.realtime_position = false, .start_delay_s = delay_s}), 10), 0.05,
                 format(delay_s));
}

TEST(Stalls, AModelledSlideThatTakesTooLongIsDoubted) {
  for (const double slowness : {1.3, 1.9}) {
    const FaultVerdict slow = slide(running_rig({.realtime_position = false, .slowness = slowness}), 10);
    EXPECT_FALSE(slow.realtime);
    EXPECT_NE(slow.doubt.find("the head may have been"), std::string::npos) << slow.doubt;
  }
}

TEST(Stalls, ReportsEveryThirteenMillisecondsChangeNothing) {
  for (const bool in_the_slide : {false, true}) {
    const FaultVerdict reported =
        slide(running_rig({.auto_position_s = 0.013, .deaf_to_m154 = in_the_slide}), 10);
    expect_right(reported, 0.05, in_the_slide ? "in the slide" : "");
    EXPECT_TRUE(reported.realtime);
  }
}

TEST(Stalls, ChunksOfAnAdapterChangeNothing) {
  for (const double chunk_s : {0.004, 0.016, 0.1}) {
    RigSettings rig = running_rig();
    rig.chunk_s = chunk_s;
    const FaultVerdict chunked = slide(rig, 10);
    expect_right(chunked, 0.1, format(chunk_s));
    EXPECT_EQ(chunked.left_out, 0U) << chunk_s;
    EXPECT_LE(chunked.missing, 1U) << chunk_s;
  }
}

// Klipper's host answers M400 at its next look, 0.1 s apart: positions are kept, and doubted by as much.
TEST(Stalls, KlippersCollectionIsCompleteAndSaysWhatItsM400IsWorth) {
  const FaultVerdict klipper = slide(running_rig({.firmware = Firmware::klipper}), 10);
  EXPECT_TRUE(klipper.complete) << klipper.error;
  EXPECT_EQ(klipper.broken, "");
  EXPECT_NE(klipper.doubt.find("the head may have been"), std::string::npos) << klipper.doubt;
  EXPECT_LT(klipper.worst_mm, 1.5);
}

// Of six moves a speed; damage has made the second early answer of each a late one.
TEST(Stalls, ADamagedAnswerDoesNotHideHowFarTheOthersLieApart) {
  std::vector<Leg> legs = {{1, Phase::slide, {}, {0, 40, 0}, 5, 0, 8.3}};
  for (const double speed : {5.0, 1.25})
    for (const double more_s : {0.303, 0.303, 0.268, 0.319, 0.333, 0.333})
      legs.push_back({1, Phase::approach, {}, {0, speed, 0}, speed, 0, 1 + more_s});
  EXPECT_NEAR(timing_of(legs).spread_s, 0.065, 0.001);
}

// Right within 0.3 mm, incomplete, or doubted: never wrong in silence.
TEST(StalledCollections, AreRightOrSaySo) {
  for (const bool of_the_host : {false, true}) {
    int right = 0, doubted = 0;
    for (std::uint64_t seed = 1; seed <= 60; ++seed) {
      const double rate = seed % 3 == 0 ? 0.0003 : 0.001;
      RigSettings rig =
          running_rig({.realtime_position = of_the_host ? seed % 4 != 0 : seed % 2 == 0},
                      of_the_host ? RigFaults{.host_freeze_rate = rate} : RigFaults{.freeze_rate = rate});
      rig.seed = seed;
      rig.chunk_s = seed % 5 == 0 ? 0.016 : 0;
      const FaultVerdict verdict = slide(rig, seed % 4 == 3 ? 5 : 10);
      EXPECT_EQ(verdict.broken, "") << "seed " << seed
                                    << (of_the_host ? ", the host" : ", board and printer");
      if (verdict.complete) ++(verdict.doubt.empty() ? right : doubted);
    }
    EXPECT_GT(right, of_the_host ? 20 : 5);
    EXPECT_GT(doubted, 3);
  }
}

RigSettings faulty(const RigFaults& faults, std::uint64_t seed, Firmware firmware = Firmware::marlin) {
  RigSettings rig = running_rig({.firmware = firmware}, faults);
  rig.seed = seed;
  return rig;
}

TEST(FaultRun, TwoPassesAtTwoPerMilleOfTheBytes) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    for (const Firmware firmware : {Firmware::marlin, Firmware::marlin_before_2_1_2}) {
      const FaultVerdict verdict =
          run_faulty_collection(faulty({.byte_rate = 0.002}, seed, firmware), {.passes = 2});
      EXPECT_EQ(verdict.broken, "") << "seed " << seed;
      EXPECT_TRUE(verdict.complete) << "seed " << seed << ": " << verdict.error;
    }
  }
}

// SUPERTAC_MUTATIONS says how many; bench/results/rig/faults.csv has 2,000 such runs.
TEST(FaultRun, DrawnRigsAreRightOrSaySo) {
  const int runs = mutations(36);
  int complete = 0;
  for (int i = 0; i < runs; ++i) {
    const std::uint64_t seed = 900'000 + static_cast<std::uint64_t>(i);
    const DrawnRun run(seed);
    const FaultVerdict verdict = run_faulty_collection(run.rig, run.plan, run.origin);
    EXPECT_EQ(verdict.broken, "") << "seed " << seed << ", " << verdict.error;
    complete += verdict.complete ? 1 : 0;
  }
  EXPECT_GT(complete, runs / 2);
}

TEST(FaultRun, EverythingAtOnceIsNeverAFalseDone) {
  const RigFaults faults{.byte_rate = 0.002,
                         .lost_ok_rate = 0.002,
                         .resend_storm_rate = 0.0002,
                         .reset_rate = 1e-5,
                         .stall_rate = 0.0002,
                         .lost_frame_rate = 0.002};
  for (std::uint64_t seed = 1; seed <= 6; ++seed)
    EXPECT_EQ(run_faulty_collection(faulty(faults, seed), {.passes = 2}).broken, "") << "seed " << seed;
}

}  // namespace supertac::fault_run_test
