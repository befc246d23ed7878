#include "models/training/loss/schedule.h"

#include <gtest/gtest.h>

namespace supertac {
namespace {

TEST(Schedule, RisesThenFallsAlongACosine) {
  const Schedule s{.peak = 2, .warm_up = 4, .total = 104};
  EXPECT_DOUBLE_EQ(s.at(0), 0.5);
  EXPECT_DOUBLE_EQ(s.at(3), 2);
  EXPECT_DOUBLE_EQ(s.at(4), 2);
  EXPECT_NEAR(s.at(54), 1, 1e-12);
  EXPECT_NEAR(s.at(104), 0, 1e-12);
  EXPECT_NEAR(s.at(1000), 0, 1e-12);
  for (int i = 5; i < 104; ++i) EXPECT_LT(s.at(i), s.at(i - 1));
}

TEST(Schedule, ShorterThanItsWarmUp) {
  const Schedule all_warm_up{.peak = 2, .warm_up = 10, .total = 5};
  EXPECT_DOUBLE_EQ(all_warm_up.at(4), 1);
  EXPECT_DOUBLE_EQ(all_warm_up.at(20), 2);
}

}  // namespace
}  // namespace supertac
