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
  EXPECT_NEAR(doubt_of(all(0.3F), all(0.1F), kGrid), 0.01 / (0.01 + 0.005), 1e-6);
  EXPECT_NEAR(doubt_of(all(0.3F), all(0), kGrid), 1e-4 / (1e-4 + 0.005), 1e-6)
      << "no predicted_error is below .01";
}

// Seven lines of stripes 0 and h: variance h^2 12 / 49.
TEST(Doubt, AnErrorSpoilsAFaintTextureSooner) {
  const double strong = doubt_of(stripes(1), all(0.2F), kGrid),
               faint = doubt_of(stripes(0.2F), all(0.2F), kGrid);
  EXPECT_NEAR(strong, 0.04 / (2 * 12.0 / 49 + 0.04 + 0.005), 1e-6);
  EXPECT_NEAR(faint, 0.04 / (2 * 0.04 * 12 / 49 + 0.04 + 0.005), 1e-6);
  EXPECT_GT(faint, 2 * strong);
  EXPECT_GT(doubt_of(stripes(1), all(0.3F), kGrid), strong);
}

// A wrong corner counts in the squares that hold it.
TEST(Doubt, OfOneBadPixelIsThatOfItsSquares) {
  std::vector<float> predicted_error = all(0);
  predicted_error[0] = 0.7F;
  const double usual = 1e-4 / (1e-4 + 0.005), here = (0.49 + 48e-4) / 49 / ((0.49 + 48e-4) / 49 + 0.005);
  EXPECT_NEAR(doubt_of(all(0), predicted_error, kGrid), (99 * usual + here) / 100, 1e-6);
}

TEST(Doubt, OfPicturesSmallerThanASquare) {
  const std::vector<float> four(16, 0.5F), predicted_error(16, 0.1F);
  EXPECT_NEAR(doubt_of(four, predicted_error, {.height = 4, .width = 4, .pixel_mm = 1}), 0.01 / 0.015, 1e-6);
}

}  // namespace
}  // namespace supertac
