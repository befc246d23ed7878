#include "io/images/images.h"

#include "io/files/file.h"
#include "tests/support/test.h"

#define STB_IMAGE_STATIC
#define STB_IMAGE_IMPLEMENTATION
#define STBI_ONLY_PNG
#include <stb/stb_image.h>

namespace supertac::images_test {

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

TEST(Panel, DrawsYUpwardsAndXToTheRight) {
  const std::vector<float> values{0, 0.25F, 0.5F, 1};  // row 0 (small y): 0, .25; row 1: .5, 1
  Picture picture(4, 4);
  draw_panel(picture, {0, 0, 4, 4}, values, 2, 2);
  EXPECT_EQ(picture.at(0, 3), colour_of(0));
  EXPECT_EQ(picture.at(3, 3), colour_of(0.25F));
  EXPECT_EQ(picture.at(0, 0), colour_of(0.5F));
  EXPECT_EQ(picture.at(2, 1), colour_of(1));
}

TEST(Panel, StaysInsideThePicture) {
  Picture picture(4, 4);
  const std::vector<float> values(4);
  EXPECT_ERROR(draw_panel(picture, {1, 0, 4, 4}, values, 2, 2), std::invalid_argument,
               "a panel of 4 x 4 pixels at (1, 0) leaves the picture of");
  EXPECT_ERROR(draw_panel(picture, {0, 0, 4, 4}, values, 3, 2), std::invalid_argument,
               "draw_panel: expects 3 x 2 values, got 4");
}

TEST(Picture, HasSidesOf1To65535Pixels) {
  EXPECT_EQ(Picture(65535, 1).rgb.size(), 3u * 65535);
  EXPECT_THROW(Picture(65536, 1), std::invalid_argument);
  EXPECT_THROW(Picture(1, 0), std::invalid_argument);
}

constexpr StripLayout kSmall{.scale = 2, .side = 16};

struct Windows {
  std::vector<float> input = std::vector<float>(16, 0.0F), output = std::vector<float>(64, 0.5F),
                     truth = std::vector<float>(64, 1.0F);
  Strip strip() const { return {input, output, truth, {}}; }
};

TEST(Strips, StandInputOutputTruthSideBySide) {
  const Windows windows;
  const std::vector<Strip> strips(2, windows.strip());
  const Picture picture = strip_picture(strips, kSmall);
  EXPECT_EQ(picture.width, 3 * 16 + 4);
  EXPECT_EQ(picture.height, 2 * 17 + 1);
  EXPECT_EQ(picture.at(0, 0), (Rgb{255, 255, 255}));
  EXPECT_EQ(picture.at(1, 1), colour_of(0));
  EXPECT_EQ(picture.at(18, 18), colour_of(0.5F));
  EXPECT_EQ(picture.at(35, 1), colour_of(1));
}

TEST(Strips, ShowTheDoubtBehindTheTruth) {
  const Windows windows;
  Strip strip = windows.strip();
  strip.uncertainty = windows.output;
  const std::vector<Strip> strips{windows.strip(), strip};
  const Picture across = strip_picture(strips, kSmall), down = film_picture(strips, kSmall);
  EXPECT_EQ(across.width, 4 * 17 + 1);
  EXPECT_EQ(across.at(52, 1), (Rgb{255, 255, 255}));  // the first has none
  EXPECT_EQ(across.at(52, 18), colour_of(0.5F));
  EXPECT_EQ(down.at(18, 52), colour_of(0.5F));
}

TEST(Film, HasAColumnPerWindow) {
  const Windows windows;
  const std::vector<Strip> strips(5, windows.strip());
  const Picture picture = film_picture(strips, kSmall);
  EXPECT_EQ(picture.width, 5 * 17 + 1);
  EXPECT_EQ(picture.height, 3 * 16 + 4);
  EXPECT_EQ(picture.at(70, 1), colour_of(0));
  EXPECT_EQ(picture.at(70, 18), colour_of(0.5F));
  EXPECT_EQ(picture.at(70, 35), colour_of(1));
}

TEST(Strips, KeepTheShapeOfTheArray) {
  const std::vector<float> input{0, 0, 0, 0, 0, 1, 0, 0}, output(32, 0.5F), truth(32, 1.0F);
  const std::vector<Strip> strips(1, {input, output, truth, {}});
  const StripLayout layout{.rows = 2, .columns = 4, .scale = 2, .side = 16};
  const Picture across = strip_picture(strips, layout), down = film_picture(strips, layout);
  EXPECT_EQ(across.width, 3 * 16 + 4);
  EXPECT_EQ(across.height, 8 + 2);
  EXPECT_EQ(across.at(1 + 4, 1), colour_of(1));  // row 1 is on top
  EXPECT_EQ(across.at(1 + 4, 1 + 4), colour_of(0));
  EXPECT_EQ(down.width, 16 + 2);
  EXPECT_EQ(down.height, 3 * 8 + 4);
  EXPECT_EQ(down.at(1, 1 + 2 * 9), colour_of(1));
}

TEST(Strips, RefuseNothingAndTooMuch) {
  EXPECT_ERROR(strip_picture({}, kSmall), std::invalid_argument, "there is no window to draw");
  const Windows windows;
  EXPECT_THROW(film_picture(std::vector<Strip>(2000, windows.strip()), {.scale = 2, .side = 64}),
               std::invalid_argument);
  EXPECT_THROW(strip_picture(std::vector<Strip>(1, windows.strip()), {.scale = 4, .side = 16}),
               std::invalid_argument);
}

TEST(Png, ReadsBackAsDrawn) {
  const Windows windows;
  const Picture picture = strip_picture(std::vector<Strip>(1, windows.strip()), kSmall);
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

}  // namespace supertac::images_test
