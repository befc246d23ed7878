// What predicted errors mean, on pixels whose intervals can be written down.
#include "models/inference/interval.h"

#include "tests/support/test.h"

namespace supertac::interval_test {

const float kNaN = std::nanf("");

TEST(PixelInterval, GrowsWithTheSlopeAndThePredictedError) {
  const std::vector<float> picture = {0, 0, 0, 0,  //
                                      0, 0, 1, 0,  //
                                      0, 0, 0, 0.5F};
  const std::vector<float> errors(12, 0.1F);
  std::vector<float> widths;
  PixelInterval{0.5, 2}.half_widths(picture, 4, errors, widths);
  const float expected[] = {0.2F, 0.7F, 0.7F, 0.7F, 0.2F, 0.7F, 0.7F, 0.7F, 0.2F, 0.7F, 0.7F, 0.45F};
  ASSERT_EQ(widths.size(), 12U);
  for (std::size_t i = 0; i < 12; ++i) EXPECT_FLOAT_EQ(widths[i], expected[i]) << i;
  PixelInterval{0, 5}.half_widths(picture, 4, std::vector<float>(12, -3.0F), widths);
  EXPECT_FLOAT_EQ(widths[6], 0.05F) << "no predicted error is below 0.01";
  PixelInterval{0, 50}.half_widths(picture, 4, errors, widths);
  EXPECT_FLOAT_EQ(widths[6], 1) << "truths lie in 0 to 1";
  PixelInterval{}.half_widths(picture, 4, {}, widths);
  EXPECT_TRUE(widths.empty());
}

TEST(PixelInterval, LeavesOutWhatIsNotKnown) {
  std::vector<float> errors = {0.1F, kNaN, 0.1F, 0.1F};
  const std::vector<float> picture = {1, kNaN, 0.8F, 1};
  PixelInterval{1, 1}.half_widths(picture, 2, errors, errors);  // in place
  EXPECT_FLOAT_EQ(errors[0], 0.3F);
  EXPECT_TRUE(std::isnan(errors[1]));
  EXPECT_FLOAT_EQ(errors[3], 0.3F);
}

TEST(PixelInterval, IsReadAsItIsWritten) {
  EXPECT_EQ((PixelInterval{0.5, 3}).text(), "0.5,3");
  EXPECT_EQ(PixelInterval::read("0.5,3"), (PixelInterval{0.5, 3}));
  EXPECT_EQ(PixelInterval::read("1.45"), (PixelInterval{0, 1.45})) << "what older model files say";
  EXPECT_EQ(PixelInterval::read("1.45")->text(), "1.45");
  EXPECT_EQ((PixelInterval{0, 3, 16}).text(), "0,3,16");
  EXPECT_EQ(PixelInterval::read("0.5,3,16"), (PixelInterval{0.5, 3, 16}));
  for (const char* wrong : {"", "1,2,3,4", "1,2,-3", "1,x", "-1,1", "1,0", "101", "nan"})
    EXPECT_FALSE(PixelInterval::read(wrong)) << wrong;
}

// A window of two frames of 1x2 taxels with two channels, a picture of 2x4: the last frame counts.
TEST(PixelInterval, ALoadIsThatOfThePixelsTaxel) {
  const NetworkFormat format{.frames = 2, .rows = 1, .columns = 2, .channels = 2, .scale = 2};
  const std::vector<float> window = {9, 9, 9, 9, 1, 3, 0, 5}, predicted(8, 0.5F);
  std::vector<float> errors;
  PixelInterval{.load = 2}.with_load(format, window, predicted, errors);
  EXPECT_EQ(errors, (std::vector<float>{4.5F, 4.5F, 5.5F, 5.5F, 4.5F, 4.5F, 5.5F, 5.5F}));
  PixelInterval{}.with_load(format, window, predicted, errors);
  EXPECT_EQ(errors, predicted);
}

// Errors of 0.1, 0.2 .. 1 where 0.1 was predicted: a factor of 9 covers nine of ten, and in a class a tenth
// as far off one of 0.9; the larger one is for all.
TEST(IntervalCoverage, FindsTheFactorThatHoldsEachHeight) {
  std::vector<float> truth(20, 0.0F), picture(20), predicted(20, 0.1F);
  for (std::size_t i = 0; i < 10; ++i) picture[i] = 0.1F * static_cast<float>(i) + 0.097F;
  for (std::size_t i = 10; i < 20; ++i)
    picture[i] = 1, truth[i] = 1 + 0.01F * static_cast<float>(i - 10) + 0.0097F;
  IntervalCoverage coverage(PixelInterval{0, 5});
  EXPECT_TRUE(coverage.empty());
  coverage.add(3, picture, 20, truth, predicted);
  EXPECT_DOUBLE_EQ(coverage.share(), 0.75);
  EXPECT_EQ(coverage.found(), (PixelInterval{0, 9}));
  EXPECT_NEAR(coverage.half_width(), 0.5, 1e-6);
  EXPECT_DOUBLE_EQ(coverage.of_height(0).share, 0.5);
  EXPECT_DOUBLE_EQ(coverage.of_height(3).share, 1);
  EXPECT_NEAR(coverage.of_height(3).half_width, 0.5, 1e-6);
  EXPECT_DOUBLE_EQ(coverage.of_height(1).pixels, 0);
}

// A step of 1 that stands a pixel beside the truth is held by a shift of one pixel, whatever was predicted.
TEST(IntervalCoverage, AShiftHoldsWhatStandsBeside) {
  std::vector<float> truth(256, 0.0F), picture(256, 0.0F), predicted(256, 0.0F);
  for (std::size_t i = 0; i < 256; ++i) truth[i] = i % 16 >= 8 ? 1 : 0, picture[i] = i % 16 >= 9 ? 1 : 0;
  IntervalCoverage still(PixelInterval{0, 1}), shifted(PixelInterval{1, 1});
  still.add(0, picture, 16, truth, predicted);
  shifted.add(0, picture, 16, truth, predicted);
  EXPECT_DOUBLE_EQ(still.of_height(3).share, 7.0 / 8);
  EXPECT_EQ(still.found().factor, 20);
  EXPECT_DOUBLE_EQ(shifted.share(), 1);
  EXPECT_EQ(shifted.found(), (PixelInterval{1, 0.05}));
}

// A long pass that is all right and a short one that is not: each is half of the mean.
TEST(IntervalCoverage, PassesCountTheSame) {
  const std::vector<float> right(30, 0.0F), wrong(30, 0.5F), predicted(30, 0.001F);
  IntervalCoverage coverage(PixelInterval{0, 1});
  for (int i = 0; i < 9; ++i) coverage.add(0, right, 30, right, predicted);
  coverage.add(1, wrong, 30, right, predicted);
  EXPECT_DOUBLE_EQ(coverage.share(), 0.5);
  EXPECT_EQ(coverage.found().factor, 20) << "50 least predicted errors are beyond the last bin";
}

}  // namespace supertac::interval_test
