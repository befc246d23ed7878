#include "models/inference/interval.h"

#include <gtest/gtest.h>

#include <vector>

namespace supertac {
namespace {

// Errors of 0.1, 0.2 .. 1 where 0.1 was predicted: ratios 1 .. 10, and a factor of 9 covers nine of ten.
TEST(IntervalCoverage, IsTheShareOfPixelsWithinTheFactor) {
  std::vector<float> truth(10), picture(10, 0.0F), predicted(10, 0.1F);
  for (std::size_t i = 0; i < 10; ++i) truth[i] = 0.1F * static_cast<float>(i) + 0.097F;
  IntervalCoverage coverage;
  EXPECT_TRUE(coverage.empty());
  coverage.add(3, picture, truth, predicted);
  EXPECT_DOUBLE_EQ(coverage.of(5), 0.5);
  EXPECT_DOUBLE_EQ(coverage.factor(), 9);
}

// A long pass that is all right and a short one that is not: each is half of the mean.
TEST(IntervalCoverage, PassesCountTheSame) {
  const std::vector<float> right(30, 0.0F), wrong(30, 0.5F), predicted(30, 0.001F);
  IntervalCoverage coverage;
  for (int i = 0; i < 9; ++i) coverage.add(0, right, right, predicted);
  coverage.add(1, right, wrong, predicted);
  EXPECT_DOUBLE_EQ(coverage.of(1), 0.5);
  EXPECT_DOUBLE_EQ(coverage.of(20), 0.5);
  EXPECT_DOUBLE_EQ(coverage.of(50), 0.5);
  EXPECT_DOUBLE_EQ(coverage.factor(), 20) << "50 least predicted errors are beyond the last bin";
}

}  // namespace
}  // namespace supertac
