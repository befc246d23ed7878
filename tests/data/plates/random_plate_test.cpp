#include "data/plates/plate.h"

#include "io/numbers/hash.h"
#include "tests/support/test.h"

namespace supertac::random_plate_test {

TEST(RandomPlate, IsWhatItsNumberSays) {
  for (const std::uint32_t number : {0U, 7U, 4'000'000'000U}) {
    const Plate a = random_plate(number), b = Plate::named("random" + std::to_string(number));
    EXPECT_EQ(a.name(), b.name());
    for (double y = 20; y < 90; y += 1.7)
      for (double x = 0; x < 36; x += 3.1) ASSERT_EQ(a.height(x, y), b.height(x, y)) << number;
  }
  for (const char* name : {"random", "random-1", "random4294967296"})
    EXPECT_THROW(Plate::named(name), std::invalid_argument) << name;
}

// A seed's plates are the same for ever: trainings are repeated from it.
TEST(RandomPlate, PinnedBits) {
  Hash hash;
  for (std::uint32_t number = 0; number < 64; ++number) {
    const Plate plate = random_plate(number);
    for (double y = 0; y < 108; y += 0.9)
      for (double x = 0; x < 36; x += 2.1) hash.add(static_cast<float>(plate.height(x, y)));
  }
  EXPECT_EQ(hash.hex(), "30417ebc997890c2");
}

TEST(RandomPlate, HasEveryKindOfTextureWithinItsBounds) {
  std::map<std::string, int> kinds;
  int plain = 0, oblique_or_scattered = 0, two = 0;
  for (std::uint32_t number = 0; number < 400; ++number) {
    const Plate plate = random_plate(number);
    EXPECT_GE(plate.min_height(), -3) << number;
    EXPECT_LE(plate.max_height(), 3) << number;
    EXPECT_GE(plate.texture_begin(), 0) << number;
    EXPECT_LE(plate.texture_end(), rig::kPlateLengthMm) << number;
    EXPECT_EQ(plate.height(18, 2), 0) << number;  // the onset is on the flat plate
    plain += plate.max_height() == 0 ? 1 : 0;
    two += plate.textures().size() == 2 ? 1 : 0;
    oblique_or_scattered += plate.textures().empty() && !plate.uniform_in_x() ? 1 : 0;
    for (const Texture& t : plate.textures()) {
      ++kinds[t.kind];
      EXPECT_GE(t.pitch_mm, 4);
      EXPECT_LE(t.pitch_mm, 15);
    }
  }
  EXPECT_EQ(kinds.size(), 4U);
  for (const auto& [kind, count] : kinds) EXPECT_GT(count, 20) << kind;
  EXPECT_NEAR(plain, 47, 15);
  EXPECT_GT(two, 15);
  EXPECT_GT(oblique_or_scattered, 40);
}

// What the surface says of itself must be what its heights say.
TEST(RandomPlate, KnowsItsHeightExtentAndDirection) {
  for (std::uint32_t number = 0; number < 60; ++number) {
    const Plate plate = random_plate(number);
    double highest = 0;
    for (double y = 0; y <= rig::kPlateLengthMm; y += 0.25)
      for (double x = 0; x <= rig::kPlateWidthMm; x += 0.5) {
        const double z = plate.height(x, y);
        highest = std::max(highest, z);
        if (z != 0) {
          EXPECT_GE(y, plate.texture_begin() - 1e-9) << number;
          EXPECT_LE(y, plate.texture_end() + 1e-9) << number;
        }
        ASSERT_TRUE(!plate.uniform_in_x() || z == plate.height(0, y)) << number;
      }
    EXPECT_LE(highest, plate.max_height() + 1e-12) << number;
    EXPECT_GE(highest, 0.8 * plate.max_height()) << number;
  }
}

TEST(RandomPlate, ResemblanceIsKindAndPitch) {
  const auto resembles = [](const char* a, const char* b) {
    return resemble(Plate::named(a), Plate::named(b));
  };
  EXPECT_TRUE(resembles("3_Bumps", "bumps12"));
  EXPECT_TRUE(resembles("bumps11.6h1", "3_Bumps"));
  EXPECT_TRUE(resembles("ridges4+bumps12", "3_Bumps"));
  EXPECT_FALSE(resembles("bumps11.4", "3_Bumps"));
  EXPECT_FALSE(resembles("ridges12", "3_Bumps"));
  EXPECT_FALSE(resembles("plain", "3_Bumps"));
}

}  // namespace supertac::random_plate_test
