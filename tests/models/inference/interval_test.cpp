// How doubtful a picture is, on pictures whose doubt can be written down.
#include "models/inference/interval.h"

#include <gtest/gtest.h>

#include <vector>

namespace supertac {
namespace {

const ImageGrid kGrid{};
std::vector<float> all(float value) { return std::vector<float>(kGrid.pixels(), value); }
std::vector<float> stripes(float height) {
  std::vector<float> picture(kGrid.pixels());
  for (std::size_t i = 0; i < picture.size(); ++i) picture[i] = i / 16 % 2 == 0 ? height : 0;
  return picture;
}

TEST(Doubt, OfAFlatPictureIsTheErrorsShare) {
  EXPECT_NEAR(expected_ssim_loss(all(0.3F), all(0.1F), kGrid), 0.01 / (0.01 + 0.005), 1e-6);
  EXPECT_NEAR(expected_ssim_loss(all(0.3F), all(0), kGrid), 1e-4 / (1e-4 + 0.005), 1e-6)
      << "no predicted_error is below .01";
}

// Seven lines of stripes 0 and h: variance h^2 12 / 49.
TEST(Doubt, AnErrorSpoilsAFaintTextureSooner) {
  const double strong = expected_ssim_loss(stripes(1), all(0.2F), kGrid),
               faint = expected_ssim_loss(stripes(0.2F), all(0.2F), kGrid);
  EXPECT_NEAR(strong, 0.04 / (2 * 12.0 / 49 + 0.04 + 0.005), 1e-6);
  EXPECT_NEAR(faint, 0.04 / (2 * 0.04 * 12 / 49 + 0.04 + 0.005), 1e-6);
  EXPECT_GT(faint, 2 * strong);
  EXPECT_GT(expected_ssim_loss(stripes(1), all(0.3F), kGrid), strong);
}

// A wrong corner counts in the squares that hold it.
TEST(Doubt, OfOneBadPixelIsThatOfItsSquares) {
  std::vector<float> predicted_error = all(0);
  predicted_error[0] = 0.7F;
  const double usual = 1e-4 / (1e-4 + 0.005), here = (0.49 + 48e-4) / 49 / ((0.49 + 48e-4) / 49 + 0.005);
  EXPECT_NEAR(expected_ssim_loss(all(0), predicted_error, kGrid), (99 * usual + here) / 100, 1e-6);
}

TEST(Doubt, OfPicturesSmallerThanASquare) {
  const std::vector<float> four(16, 0.5F), predicted_error(16, 0.1F);
  EXPECT_NEAR(expected_ssim_loss(four, predicted_error, {.height = 4, .width = 4, .pixel_mm = 1}),
              0.01 / 0.015, 1e-6);
}

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
