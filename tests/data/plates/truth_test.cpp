#include "data/plates/truth.h"

#include "io/numbers/random.h"
#include "tests/data/test_recordings.h"
#include "tests/support/test.h"

namespace supertac::truth_test {

// One hemisphere, centred on (18, 54): with the finger 3 mm left and 4 mm short of it, the scene is symmetric
// in neither direction, so a swapped or mirrored axis shows.
const Plate& one_blob() {
  static const Plate plate("one blob", {{.kind = "blobs", .pitch_mm = 40, .height_mm = 1.5}});
  return plate;
}

TEST(Truth, RowsGrowWithYAndColumnsWithX) {
  std::vector<float> image(144);
  truth_image(one_blob(), 15, 50, {12, 12, 1}, image);  // first centre at (9.5, 44.5)
  EXPECT_GT(image[12 * 9 + 8], 0.8F);                   // row of y = 53.5, column of x = 17.5
  EXPECT_EQ(image[12 * 8 + 11], 0.0F);                  // its transpose side
  EXPECT_EQ(image[12 * 2 + 8], 0.0F);                   // mirrored in y
  EXPECT_EQ(image[12 * 9 + 3], 0.0F);                   // mirrored in x
}

TEST(Truth, IsZeroOnTheFlatPlateAndOneOnTopOfEveryPlate) {
  const Plate waves = Plate::named("4_Waves"), bumps = Plate::named("3_Bumps");
  EXPECT_NEAR(truth_value(waves, 5, 40.5), 1, 1e-12);
  EXPECT_NEAR(truth_value(waves, 5, 45), -1, 1e-12);
  EXPECT_EQ(truth_value(waves, 5, 30), 0);
  EXPECT_NEAR(truth_value(bumps, 5, 42), 1, 1e-12);
  EXPECT_EQ(truth_value(bumps, 5, 30), 0);
  for (double y = 20; y < 90; y += 0.77)
    for (const auto& name : kRigPlates) {
      const Plate plate = Plate::named(name);
      const double v = truth_value(plate, 7, y);
      EXPECT_GE(v, plate.min_height() < 0 ? -1 : 0) << name;
      EXPECT_LE(v, 1) << name;
    }
}

TEST(Truth, TellsContactFromNearAndFlat) {
  const ImageGrid grid;
  const Plate bumps = Plate::named("3_Bumps");  // from 39.5 to 68.5 mm; a picture reaches 6 mm either way
  EXPECT_EQ(zone_of(bumps, 18, 54, grid), Zone::contact);
  EXPECT_EQ(zone_of(bumps, 18, 34.2, grid), Zone::contact);
  EXPECT_EQ(zone_of(bumps, 18, 33, grid), Zone::near);
  EXPECT_EQ(zone_of(bumps, 18, 30, grid), Zone::flat);
  EXPECT_EQ(zone_of(bumps, 18, 78, grid), Zone::flat);
  EXPECT_EQ(zone_of(Plate::named("plain"), 18, 54, grid), Zone::flat);
}

// Pixels need not be square.
TEST(Truth, CoversEveryTaxelsSquareOfAnyArray) {
  const std::pair<TaxelArray, ImageGrid> cases[] = {
      {{}, {16, 16, 0.75}},
      {{.rows = 2, .columns = 6, .pitch_mm = 2}, {8, 24, 0.5}},
      {{.rows = 2, .columns = 3, .pitch_mm = {4, 2}}, {8, 12, {1, 0.5}}}};
  for (const auto& [array, grid] : cases) {
    SCOPED_TRACE(array.text());
    EXPECT_EQ(array.picture(4), grid);
    std::vector<float> image(grid.pixels());
    truth_image(one_blob(), 15, 52, grid, image);
    for (int r = 0; r < grid.height; ++r)
      for (int c = 0; c < grid.width; ++c) {
        const double x = 15 + (c + 0.5 - grid.width / 2.0) * grid.pixel_mm.x,
                     y = 52 + (r + 0.5 - grid.height / 2.0) * grid.pixel_mm.y;
        EXPECT_FLOAT_EQ(image[static_cast<std::size_t>(grid.width * r + c)],
                        static_cast<float>(one_blob().height(x, y) / 1.5));
      }
  }
}

TEST(Truth, RefusesAnImageOfTheWrongSize) {
  std::vector<float> image(255);
  EXPECT_REFUSAL("truth_image: image expects 256 values, got 255",
                 truth_image(Plate::named("plain"), 0, 0, ImageGrid{}, image));
  EXPECT_REFUSAL("truth_image: grid expects 1x1 pixels or more, got 0x0",
                 truth_image(Plate::named("plain"), 0, 0, {0, 0, 1}, {}));
}

constexpr std::size_t kPixels = 64, kTruths = 200;

// Of so many frames the first is pressed by 0.3 and more on a quarter of the pixels.
std::vector<float> film(double noise, double rest, std::size_t of = 2) {
  const RandomStream random(1, 0);
  std::vector<float> truth;
  for (std::size_t f = 0; f < kTruths; ++f)
    for (std::size_t p = 0; p < kPixels; ++p) {
      const double pressed = f % of == 0 && p < kPixels / 4 ? 0.3 + 0.5 * random.uniform(f) : 0;
      truth.push_back(static_cast<float>(
          std::clamp(rest + pressed + noise * random.normal(1000 + f * kPixels + p), 0.0, 1.0)));
    }
  return truth;
}

TEST(ContactLevel, TellsTheFilmsNoiseFromATouch) {
  for (const double rest : {0.0, 0.03, 0.2}) {
    const std::vector<float> truth = film(0.005, rest);
    const float level = contact_level(truth, kPixels);
    EXPECT_GT(level - rest, 0.005) << rest;
    EXPECT_LT(level - rest, 0.05) << rest;
    for (std::size_t f = 0; f < kTruths; ++f) {
      const auto first = truth.begin() + static_cast<std::ptrdiff_t>(f * kPixels);
      EXPECT_EQ(*std::max_element(first, first + kPixels) > level, f % 2 == 0) << f;
    }
  }
}

TEST(ContactLevel, IsZeroWhereNothingRests) {
  EXPECT_EQ(contact_level(film(0, 0), kPixels), 0);
  EXPECT_EQ(contact_level(film(0, 0.5), kPixels), 0.5F) << "rests, but not at 0";
  EXPECT_EQ(contact_level(film(0, 0, 1), kPixels), 0) << "never at rest";
  EXPECT_EQ(contact_level(std::vector<float>(5 * kPixels, 0.02F), kPixels), 0) << "too few frames to tell";
}

}  // namespace supertac::truth_test
