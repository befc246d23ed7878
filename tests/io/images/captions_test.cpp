#include "io/images/captions.h"

#include "tests/support/test.h"

namespace supertac::captions_test {

constexpr Rgb kBlack = {0, 0, 0}, kWhite = {255, 255, 255};

int black(const Picture& picture) {
  int count = 0;
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x) count += picture.at(x, y) == kBlack ? 1 : 0;
  return count;
}

TEST(Text, IsDrawnWithinItsSize) {
  const std::string word = "SSIM .85";
  Picture picture(text_width(word) + 8, kLineHeight + 8);
  draw_text(picture, 4, 4, word);
  EXPECT_GT(black(picture), 100);
  for (int x = 0; x < picture.width; ++x)
    for (const int y : {0, 3}) EXPECT_EQ(picture.at(x, y), kWhite) << x << "," << y;
  Picture other = picture;
  draw_text(other, 4, 4, "SSIM .86");
  EXPECT_NE(other.rgb, picture.rgb);
}

TEST(Text, OutsideIsCutAndForeignLettersAreQuestionMarks) {
  Picture picture(20, 10), marks(20, 10);
  draw_text(picture, -5, -3, "w\xff\xc3\xa4 and a long line");
  draw_text(marks, -5, -3, "w??? and a long line");
  EXPECT_EQ(picture.rgb, marks.rgb);
}

TEST(Captions, StandAroundThePictureWithAColourBar) {
  const Rgb red = {255, 0, 0};
  const Picture inside(60, 40, red);
  const Picture whole = captioned(
      inside, {.title = "title", .columns = {{30, "felt"}}, .rows = {{20, "a\nb"}}, .low = "0", .high = "1"});
  int reds = 0;
  std::set<Rgb> colours;
  for (int y = 0; y < whole.height; ++y)
    for (int x = 0; x < whole.width; ++x)
      reds += whole.at(x, y) == red ? 1 : 0, colours.insert(whole.at(x, y));
  EXPECT_EQ(reds, 60 * 40);
  for (const float v : {0.0F, 0.5F, 1.0F}) EXPECT_TRUE(colours.contains(colour_of(v))) << v;
  EXPECT_EQ(colours.size(), 256U + 3);  // the bar, red, black and white
}

}  // namespace supertac::captions_test
