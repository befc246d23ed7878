#include "io/images/images.h"

#include "io/files/file.h"
#include "tests/support/test.h"

#define STB_IMAGE_STATIC
#define STB_IMAGE_IMPLEMENTATION
#define STBI_ONLY_PNG
#include <stb/stb_image.h>

namespace supertac::images_test {

constexpr Rgb kBlack = {0, 0, 0}, kWhite = {255, 255, 255};

// CIE lightness L* of an sRGB colour.
double lightness(Rgb colour) {
  const auto linear = [](std::uint8_t v) {
    const double x = v / 255.0;
    return x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4);
  };
  const double y = 0.2126 * linear(colour[0]) + 0.7152 * linear(colour[1]) + 0.0722 * linear(colour[2]);
  return y > 0.008856 ? 116 * std::cbrt(y) - 16 : 903.3 * y;
}

TEST(ColourMap, LightnessGrowsEvenly) {
  const double low = lightness(colour_of(0)), high = lightness(colour_of(1));
  EXPECT_LT(low, 20);
  EXPECT_GT(high, 90);
  for (int i = 0; i < 16; ++i) {
    const double step = lightness(colour_of((i + 1) / 16.0F)) - lightness(colour_of(i / 16.0F));
    EXPECT_GT(step, 0.5 * (high - low) / 16) << i;
    EXPECT_LT(step, 1.5 * (high - low) / 16) << i;
  }
}

TEST(ColourMap, ClipsAndShowsWhatIsNotANumber) {
  EXPECT_EQ(colour_of(-3), colour_of(0));
  EXPECT_EQ(colour_of(3), colour_of(1));
  EXPECT_EQ(colour_of(std::numeric_limits<float>::quiet_NaN()), (Rgb{255, 0, 0}));
}

TEST(PanelGrid, DrawsYUpwardsAndXToTheRight) {
  const std::vector<float> values{0, 0.25F, 0.5F, 1};  // row 0 (small y): 0, 0.25; row 1: 0.5, 1
  const Picture picture = panel_grid(std::vector<PanelValues>{{values, 2, 2}}, 1, 4);
  EXPECT_EQ(picture.at(1, 4), colour_of(0));
  EXPECT_EQ(picture.at(4, 4), colour_of(0.25F));
  EXPECT_EQ(picture.at(1, 1), colour_of(0.5F));
  EXPECT_EQ(picture.at(3, 2), colour_of(1));
  EXPECT_REFUSAL("panel_grid: panel expects 6 values, got 4",
                 panel_grid(std::vector<PanelValues>{{values, 3, 2}}, 1, 4));
}

TEST(Picture, HasSidesOf1To65535Pixels) {
  EXPECT_EQ(Picture(65535, 1).rgb.size(), 3u * 65535);
  EXPECT_THROW(Picture(65536, 1), std::invalid_argument);
  EXPECT_REFUSAL("picture: sides expects 1 to 65535 pixels, got 1x0; draw fewer windows or smaller panels",
                 Picture(1, 0));
}

TEST(PanelGrid, FillsRowsFromTheTopAndLeavesWhatHasNoValuesEmpty) {
  const std::vector<float> coarse(16, 0.0F), half(64, 0.5F), full(64, 1.0F);
  const std::vector<PanelValues> panels{{coarse, 4, 4}, {half, 8, 8}, {full, 8, 8}, {half, 8, 8}, {{}, 8, 8}};
  const Picture picture = panel_grid(panels, 3, 16);
  EXPECT_EQ(picture.width, 3 * 16 + 4);
  EXPECT_EQ(picture.height, 2 * 16 + 3);
  EXPECT_EQ(picture.at(1, 1), colour_of(0));
  EXPECT_EQ(picture.at(18, 1), colour_of(0.5F));
  EXPECT_EQ(picture.at(35, 1), colour_of(1));
  EXPECT_EQ(picture.at(1, 18), colour_of(0.5F));
  for (const auto& [x, y] : {std::pair(0, 0), {18, 18}, {35, 18}}) EXPECT_EQ(picture.at(x, y), kWhite);
}

TEST(PanelGrid, KeepsTheShapeOfTheArray) {
  const std::vector<float> input{0, 0, 0, 0, 0, 1, 0, 0}, output(32, 0.5F);
  const Picture picture = panel_grid(std::vector<PanelValues>{{input, 2, 4}, {output, 4, 8}}, 1, 16);
  EXPECT_EQ(picture.width, 16 + 2);
  EXPECT_EQ(picture.height, 2 * 8 + 3);
  EXPECT_EQ(picture.at(1 + 4, 1), colour_of(1));  // row 1 is on top
  EXPECT_EQ(picture.at(1 + 4, 1 + 4), colour_of(0));
  EXPECT_EQ(picture.at(1, 1 + 9), colour_of(0.5F));
}

TEST(PanelGrid, RefusesNothingAndTooMuch) {
  EXPECT_REFUSAL("panel_grid: panels expects 1 or more, got 0", panel_grid({}, 3, 16));
  const std::vector<float> values(256);
  EXPECT_THROW(panel_grid(std::vector<PanelValues>(2000, {values, 16, 16}), 2000, 64), std::invalid_argument);
  EXPECT_REFUSAL("panel_grid: side expects 16 pixels or more, one for a value, got 15",
                 panel_grid(std::vector<PanelValues>{{values, 16, 16}}, 1, 15));
}

TEST(Png, ReadsBackAsDrawn) {
  const std::vector<float> values{0, 0.5F, 0.75F, 1};
  const Picture picture = panel_grid(std::vector<PanelValues>{{values, 2, 2}}, 1, 16);
  const std::string path = ::testing::TempDir() + "supertac_images_test.png";
  write_png(path, picture);
  const auto bytes = read_file(path, 1 << 20);
  std::filesystem::remove(path);
  int width = 0, height = 0, channels = 0;
  unsigned char* pixels =
      stbi_load_from_memory(reinterpret_cast<const unsigned char*>(bytes.data()),
                            static_cast<int>(bytes.size()), &width, &height, &channels, 3);
  ASSERT_NE(pixels, nullptr);
  const std::vector<std::uint8_t> read(pixels, pixels + picture.rgb.size());
  stbi_image_free(pixels);
  EXPECT_EQ(width, picture.width);
  EXPECT_EQ(height, picture.height);
  EXPECT_EQ(read, picture.rgb);
}

TEST(Png, NamesAPathThatCannotBeWritten) {
  EXPECT_ERROR(write_png("/nowhere/at/all.png", Picture(2, 2)), FileError, "/nowhere/at/all.png: ");
}

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
  Picture inside(60, 40);
  for (std::size_t i = 0; i < inside.rgb.size(); ++i) inside.rgb[i] = red[i % 3];
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

}  // namespace supertac::images_test
