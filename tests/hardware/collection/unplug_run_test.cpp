#include "tests/hardware/unplug_run.h"

#include <gtest/gtest.h>

#include <string>

namespace supertac {
namespace {

// The 100 pulls of each plug that are promised are a program of their own: rig_unplug_runs.
TEST(UnplugRun, AReaderNoticesWithin100Milliseconds) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    for (const Plug plug : {Plug::board, Plug::printer})
      EXPECT_EQ(unplug_idle(plug, seed).broken, "") << seed;
  }
}

TEST(UnplugRun, ACollectionEndsWithATypedErrorAndTheFingerUp) {
  for (const Plug plug : {Plug::board, Plug::printer}) {
    const std::string broken = unplug_in_collection(plug, 1).broken;
    // How late is the test above and the program of the 100 pulls; here a busy machine may be late.
    EXPECT_TRUE(broken.empty() || broken.starts_with("noticed after")) << broken;
  }
}

}  // namespace
}  // namespace supertac
