#include "data/registration/registration_picture.h"

#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

#include "data/recordings/simulator.h"
#include "data/registration/registration.h"
#include "tests/expect_error.h"

namespace supertac {
namespace {

constexpr int kPixelsPerMm = 12, kFromMm = 20;

int column_of(double y_mm) {
  return static_cast<int>((y_mm - kFromMm) * kPixelsPerMm) + 3;
}  // beside its crest's line

int brightness(const Picture& picture, int x, int y) {
  const Rgb c = picture.at(x, y);
  return c[0] + c[1] + c[2];
}

// Middle of the band of taxel k.
int band_of(int k) { return 24 + (3 - k / 4) * 54 + 6 + (k % 4) * 12 + 6; }

TEST(RegistrationPicture, SignalsStandUnderTheElementsTheyFelt) {
  const Plate plate = Plate::named("3_Bumps");
  const Recording pass = simulate_pass(plate, {.pass = 4, .from_mm = 28});
  const Picture picture = registration_picture(pass, plate);
  for (const double crest : plate.crests()) {
    EXPECT_GT(brightness(picture, column_of(crest), 12), brightness(picture, column_of(crest + 5), 12));
    for (const int k : {4, 7, 8, 11})  // the inner rows feel every bump alike
      EXPECT_GT(brightness(picture, column_of(crest), band_of(k)),
                brightness(picture, column_of(crest + 6), band_of(k)) + 100)
          << crest << ' ' << k;
  }
  // Nothing is known before the slide begins at 28 mm, where row 1 feels 26.7.
  EXPECT_EQ(brightness(picture, column_of(25), band_of(5)), 3 * 255);
}

TEST(RegistrationPicture, AWrongStartMovesTheSignalsOffTheElements) {
  const Plate plate = Plate::named("3_Bumps");
  Recording pass = simulate_pass(plate, {.pass = 4});
  for (std::size_t i = 0; i < pass.frames(); ++i) pass.position_mm[2 * i + 1] += 6;
  const Picture picture = registration_picture(pass, plate);
  EXPECT_LT(brightness(picture, column_of(plate.crests()[1]), band_of(4)),
            brightness(picture, column_of(plate.crests()[1] + 6), band_of(4)));
}

TEST(RegistrationPicture, LeavesOutWhatIsNotKnown) {
  Recording pass = simulate_pass(Plate::named("6_Ridges"), {.pass = 4});
  pass.position_mm.clear();
  EXPECT_EQ(what_of<std::invalid_argument>([&] { registration_picture(pass, Plate::named("6_Ridges")); }),
            "registration_picture: the recording has no positions; register it first");
  pass.position_mm.assign(2 * pass.frames(), std::numeric_limits<float>::quiet_NaN());
  pass.position_mm[0] = 15;
  const Picture picture = registration_picture(pass, Plate::named("6_Ridges"));
  EXPECT_EQ(brightness(picture, column_of(42), band_of(5)), 3 * 255);
}

}  // namespace
}  // namespace supertac
