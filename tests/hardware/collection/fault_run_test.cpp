#include "tests/hardware/fault_run.h"

#include "tests/hardware/rig_support.h"
#include "tests/support/test.h"

namespace supertac::fault_run_test {

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
      EXPECT_GT(verdict.printer.faults + verdict.printer.timeouts, 10U) << "no faults were injected";
    }
  }
}

// bench/results/rig/faults.csv has 2,000 such runs.
TEST(FaultRun, DrawnRigsAreRightOrSaySo) {
  int complete = 0;
  for (std::uint64_t seed = 900'000; seed < 900'036; ++seed) {
    const DrawnRun run(seed);
    const FaultVerdict verdict = run_faulty_collection(run.rig, run.plan, run.origin);
    EXPECT_EQ(verdict.broken, "") << "seed " << seed << ", " << verdict.error;
    complete += verdict.complete ? 1 : 0;
  }
  EXPECT_GT(complete, 18);
}

TEST(FaultRun, EverythingAtOnceIsNeverAFalseDone) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    EXPECT_EQ(run_faulty_collection(faulty(RigFaults::mixed(0.002), seed), {.passes = 2}).broken, "")
        << "seed " << seed;
  }
}

}  // namespace supertac::fault_run_test
