// What predicted errors mean, on pixels whose intervals can be written down.
#include "models/inference/interval.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace supertac {
namespace {

const IntervalFactors kRising{{1, 2, 3, 4, 5}};

TEST(IntervalFactors, DependOnThePicture) {
  const float pictures[] = {0.0F, -0.019F, 0.02F, 0.1F, -0.3F, 0.5F, 2.0F}, factors[] = {1, 1, 2, 3, 4, 5, 5};
  for (std::size_t i = 0; i < std::size(pictures); ++i)
    EXPECT_FLOAT_EQ(kRising.half_width(pictures[i], 0.1F), factors[i] * 0.1F) << pictures[i];
  EXPECT_FLOAT_EQ(kRising.half_width(1, -3), 0.05F) << "no predicted error is below .01";
  std::vector<float> widths(7);
  kRising.half_widths(pictures, {}, widths);
  EXPECT_TRUE(widths.empty());
  EXPECT_TRUE(std::isnan(kRising.half_width(NAN, NAN)));
}

TEST(IntervalFactors, AreOneNumberOrFive) {
  EXPECT_EQ(kRising.text(), "1,2,3,4,5");
  EXPECT_EQ(IntervalFactors::read("1,2,3,4,5"), kRising);
  EXPECT_EQ(IntervalFactors::read("1.45")->text(), "1.45") << "what older model files say";
  for (const char* wrong : {"", "1,2", "1,2,3,4,x", "0,1,1,1,1", "101", "nan"})
    EXPECT_FALSE(IntervalFactors::read(wrong)) << wrong;
}

// Errors of 0.1, 0.2 .. 1 where 0.1 was predicted: ratios 1 .. 10, and a factor of 9 covers nine of ten.
TEST(IntervalCoverage, FindsTheFactorOfEachLevel) {
  std::vector<float> truth(20), picture(20, 0.0F), predicted(20, 0.1F);
  for (std::size_t i = 0; i < 10; ++i) truth[i] = 0.1F * static_cast<float>(i) + 0.097F;
  for (std::size_t i = 10; i < 20; ++i) {  // of the highest level, a tenth as far off
    picture[i] = 1;
    truth[i] = 1 + 0.01F * static_cast<float>(i - 10) + 0.0097F;
  }
  IntervalCoverage coverage(IntervalFactors{{5, 5, 5, 5, 5}});
  EXPECT_TRUE(coverage.empty());
  coverage.add(3, picture, truth, predicted);
  EXPECT_DOUBLE_EQ(coverage.share(), 0.75);
  EXPECT_EQ(coverage.factors(), (IntervalFactors{{9, 9, 9, 9, 0.9}}))
      << "levels without pixels: as beside them";
  EXPECT_DOUBLE_EQ(coverage.of_level(0).share, 0.5);
  EXPECT_DOUBLE_EQ(coverage.of_level(4).share, 1);
  EXPECT_NEAR(coverage.of_level(4).half_width, 0.5, 1e-6);
  EXPECT_DOUBLE_EQ(coverage.of_height(0).pixels, 0);
  EXPECT_DOUBLE_EQ(coverage.of_height(1).share, 1) << "0.097 and 0.197";
  EXPECT_DOUBLE_EQ(coverage.of_height(2).pixels, 3);
  EXPECT_DOUBLE_EQ(coverage.of_height(3).pixels, 15);
}

// A long pass that is all right and a short one that is not: each is half of the mean.
TEST(IntervalCoverage, PassesCountTheSame) {
  const std::vector<float> right(30, 0.0F), wrong(30, 0.5F), predicted(30, 0.001F);
  IntervalCoverage coverage(IntervalFactors{{1, 1, 1, 1, 1}});
  for (int i = 0; i < 9; ++i) coverage.add(0, right, right, predicted);
  coverage.add(1, right, wrong, predicted);
  EXPECT_DOUBLE_EQ(coverage.share(), 0.5);
  EXPECT_EQ(coverage.factors().of_level[0], 20) << "50 least predicted errors are beyond the last bin";
}

}  // namespace
}  // namespace supertac
