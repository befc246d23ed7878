#include "tests/hardware/unplug_run.h"

#include <gtest/gtest.h>

namespace supertac {
namespace {

// The 100 pulls of each plug that are promised, and within which time each is noticed: rig_unplug_runs.
TEST(UnplugRun, AReaderNotices) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    for (const Plug plug : {Plug::board, Plug::printer})
      EXPECT_EQ(unplug_idle(plug, seed).broken, "") << seed;
  }
}

TEST(UnplugRun, ACollectionEndsWithATypedErrorAndTheFingerUp) {
  for (const Plug plug : {Plug::board, Plug::printer}) EXPECT_EQ(unplug_in_collection(plug, 1).broken, "");
}

}  // namespace
}  // namespace supertac
