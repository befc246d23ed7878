#include "models/training/loss/collapse.h"

#include <gtest/gtest.h>

namespace supertac {
namespace {

// Two samples of one entry each, `far` to both sides of a half: a standard deviation of `far`.
BatchVariance apart(double far) {
  BatchVariance variance(1);
  Tensor batch({2, 1});
  batch.data()[0] = static_cast<real>(0.5 - far);
  batch.data()[1] = static_cast<real>(0.5 + far);
  variance.add(batch);
  return variance;
}

TEST(Senseless, IsBelowAFiftiethOrAboveTenTimesTheTruthsDeviation) {
  const BatchVariance truths = apart(0.25);
  EXPECT_TRUE(is_degenerate(apart(0), truths, 2));
  EXPECT_TRUE(is_degenerate(apart(0.25 * 0.019), truths, 2));
  EXPECT_FALSE(is_degenerate(apart(0.25 * 0.021), truths, 2));
  EXPECT_FALSE(is_degenerate(apart(0.25 * 9.9), truths, 2));
  EXPECT_TRUE(is_degenerate(apart(0.25 * 10.1), truths, 2));
  EXPECT_FALSE(is_degenerate(apart(0.25), apart(0), 2));  // flat truths say nothing of size
}

TEST(ActiveLatents, HaveAVarianceAboveAHundredth) {
  EXPECT_EQ(active_latents(apart(0.101), 2), 1);
  EXPECT_EQ(active_latents(apart(0.099), 2), 0);
}

}  // namespace
}  // namespace supertac
