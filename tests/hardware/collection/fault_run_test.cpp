#include "fault_run.h"

#include <gtest/gtest.h>

namespace supertac {
namespace {

// The 200 runs of the promise are a program of their own: rig_fault_runs.
TEST(FaultRun, TwoPassesAtTwoPerMilleOfTheBytes) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const FaultVerdict verdict = run_faulty_collection({.byte_rate = 0.002}, seed, 2);
    EXPECT_EQ(verdict.broken, "") << "seed " << seed;
    EXPECT_TRUE(verdict.complete) << "seed " << seed << ": " << verdict.error;
    EXPECT_GT(verdict.printer.faults + verdict.printer.timeouts, 10U) << "no faults were injected";
  }
}

TEST(FaultRun, EverythingAtOnceIsNeverAFalseDone) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    EXPECT_EQ(run_faulty_collection(RigFaults::mixed(0.002), seed, 2).broken, "") << "seed " << seed;
  }
}

}  // namespace
}  // namespace supertac
