#include "data/plates/plate.h"

#include "tests/support/test.h"

namespace supertac::plates_plate_test {

struct RigRow {
  const char* name;
  double begin, end, first, pitch;
  int count;
};

// Texture from-to, pitch and count as the rig's plates were made; first centre = from + half an element.
constexpr RigRow kRig[] = {
    {"3_Bumps", 39.5, 68.5, 42, 12, 3},     {"6_Bumps", 36.5, 71.5, 39, 6, 6},
    {"4_Ridges", 39.25, 68.75, 40.5, 9, 4}, {"6_Ridges", 37.75, 70.25, 39, 6, 6},
    {"4_Waves", 38.25, 69.75, 40.5, 9, 4},  {"6_Waves", 37.5, 70.5, 39, 6, 6},
    {"4_Blob", 38, 70, 40.5, 9, 4},         {"6_Blob", 36.5, 71.5, 39, 6, 6},
};

TEST(Plate, RigPlatesHaveTheirExtentAndEveryCrestIsWhereItBelongs) {
  for (const RigRow& row : kRig) {
    const Plate plate = Plate::named(row.name);
    EXPECT_EQ(plate.name(), row.name);
    EXPECT_NEAR(plate.texture_begin(), row.begin, 1e-9) << row.name;
    EXPECT_NEAR(plate.texture_end(), row.end, 1e-9) << row.name;
    EXPECT_EQ(plate.max_height(), 2.5) << row.name;
    const double x = row.pitch / 2;  // first column of the blob plates; no matter for the others
    for (int i = 0; i < row.count; ++i)
      EXPECT_NEAR(plate.height(x, row.first + i * row.pitch), 2.5, 1e-9) << row.name << " element " << i;
    EXPECT_EQ(plate.height(x, row.begin - 0.01), 0) << row.name;
    EXPECT_EQ(plate.height(x, row.end + 0.01), 0) << row.name;
    EXPECT_GT(plate.height(x, row.begin + 0.01), 0) << row.name;
    EXPECT_GT(plate.height(x, row.end - 0.01), 0) << row.name;
  }
}

TEST(Plate, ProfilesAreTriangleSemicircleSine) {
  const Plate ridges = Plate::named("4_Ridges"), bumps = Plate::named("3_Bumps"),
              waves = Plate::named("4_Waves");
  for (double d : {-1.2, -0.5, 0.3, 1.0}) {
    EXPECT_NEAR(ridges.height(9, 40.5 + d), 2.5 - 2 * std::abs(d), 1e-12);
    EXPECT_NEAR(bumps.height(9, 42 + d), std::sqrt(6.25 - d * d), 1e-12);
    EXPECT_NEAR(waves.height(9, 40.5 + d), 2.5 * std::sin(std::numbers::pi * (2.25 + d) / 4.5), 1e-12);
  }
  EXPECT_EQ(ridges.height(9, 45), 0);
  EXPECT_NEAR(waves.height(9, 45), -2.5, 1e-12);
  EXPECT_EQ(waves.min_height(), -2.5);
  EXPECT_EQ(bumps.min_height(), 0);
}

TEST(Plate, BlobsAreHemispheresOnAGrid) {
  const Plate plate = Plate::named("4_Blob");
  EXPECT_NEAR(plate.height(4.5 + 9 + 1.5, 40.5 + 18 - 2), 0, 1e-12);  // 1.5^2 + 2^2 = 2.5^2: on the rim
  EXPECT_NEAR(plate.height(4.5 + 27 + 1, 40.5 + 1), std::sqrt(6.25 - 2), 1e-12);
  EXPECT_EQ(plate.height(9, 45), 0);
  EXPECT_FALSE(plate.uniform_in_x());
  EXPECT_TRUE(Plate::named("6_Bumps").uniform_in_x());
}

TEST(Plate, GenericNamesSetPitchAndHeight) {
  EXPECT_EQ(Plate::named("bumps4").max_height(), 2);  // a higher bump would run into its neighbour
  EXPECT_EQ(Plate::named("ridges6h1.5").max_height(), 1.5);

  EXPECT_EQ(Plate::named("plain").height(18, 54), 0);
  EXPECT_EQ(Plate::named("plain").max_height(), 0);
  EXPECT_EQ(default_plates().size(), 6u);
  for (const auto& name : default_plates()) EXPECT_GT(Plate::named(name).max_height(), 0) << name;
}

TEST(Plate, MixedPlatesShareTheLength) {
  const Plate plate = Plate::named("bumps12h1+plain+waves9h2");
  EXPECT_NEAR(plate.height(3, 42), 1, 1e-12);  // one bump in [36, 48]
  EXPECT_EQ(plate.height(3, 54), 0);
  EXPECT_EQ(plate.max_height(), 2);
  EXPECT_EQ(plate.min_height(), -2);
  EXPECT_LT(plate.texture_begin(), 42);
  EXPECT_GT(plate.texture_end(), 66);
}

TEST(Plate, RefusesNamesItCannotRead) {
  const std::pair<const char*, const char*> cases[] = {
      {"", "unknown texture \"\""},
      {"7_Bumps", "unknown texture \"7_Bumps\""},
      {"bumps", "no pitch at \"\""},
      {"bumpsx", "no pitch at \"x\""},
      {"bumps0", "pitch and height must be positive"},
      {"bumps-3", "pitch and height must be positive"},
      {"ridges6h", "no height at \"\""},
      {"ridges6h1.5z", "cannot read \"z\""},
      {"+", "unknown texture \"\""},
      {"bumps6h4", "bumps are twice as wide as high and overlap at this pitch"},
      {"ridges6+", "unknown texture \"\""},
      {"bumps1e400", "cannot read \"e400\""},
      {"waves90", "no element fits between its ends"},
      {"ridgesnan", "pitch and height must be positive"},
      {"../plain", "unknown texture \"../plain\""}};
  for (const auto& [bad, why] : cases) {
    EXPECT_EQ(
        what_of<std::invalid_argument>([&] { Plate::named(bad); }),
        "plate \"" + std::string(bad) + "\": " + why +
            "; expected a rig plate such as 3_Bumps, or plain, or ridges|bumps|waves|blobs with a pitch "
            "in mm such as bumps12 or ridges6h1.5, several joined by +, or random and a number, or an STL "
            "file");
  }
}

}  // namespace supertac::plates_plate_test
