#include "data/windows/contact_level.h"

#include "io/numbers/random.h"
#include "tests/support/test.h"

namespace supertac::contact_level_test {

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

}  // namespace supertac::contact_level_test
