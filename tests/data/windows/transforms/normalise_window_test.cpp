#include "data/windows/transforms/normalise_window.h"

#include "tests/support/test.h"

namespace supertac::normalise_window_test {

constexpr std::size_t kTimes = 100, kChannels = 2;
constexpr float kStep = 1.0F / 256;

// Taxel 0 swings between rest and rest + swing, ten samples each; taxel 1 stays at `other`.
std::vector<float> window(float rest, float swing, float other = 0) {
  std::vector<float> x;
  for (std::size_t t = 0; t < kTimes; ++t) {
    x.push_back(rest + (t / 10 % 2 == 1 ? swing : 0));
    x.push_back(other);
  }
  return x;
}

std::vector<float> normalised(std::vector<float> x) {
  normalise_window(x, kChannels);
  return x;
}

TEST(NormaliseWindow, TakesHalfTheRestAndDividesByWhatIsLeft) {
  const std::vector<float> x = normalised(window(0.25F, 0.5F, 0.125F));
  EXPECT_FLOAT_EQ(x[0], 0.125F / 0.625F) << "at rest";
  EXPECT_FLOAT_EQ(x[10 * kChannels], 1) << "0.625 / 0.625: nothing is clipped";
  EXPECT_FLOAT_EQ(x[1], 0.0625F / 0.625F) << "a taxel that is pressed throughout keeps half of it";
}

// 100 frames, each of its own bin: six samples lie at or below the rest, three at or above the top.
TEST(NormaliseWindow, RestAndTopAreTheStatedPercentiles) {
  std::vector<float> x(kTimes * kChannels);
  for (std::size_t t = 0; t < kTimes; ++t) x[t * kChannels] = static_cast<float>(2 * t) * kStep;
  normalise_window(x, kChannels);
  const float rest = 10 * kStep, top = 194 * kStep;
  for (const std::size_t t : {10U, 40U, 90U})
    EXPECT_FLOAT_EQ(x[t * kChannels],
                    (static_cast<float>(2 * t) * kStep - kRestRemoved * rest) / (top - kRestRemoved * rest))
        << t;
}

TEST(NormaliseWindow, AFingerPressedHarderLooksTheSame) {
  const std::vector<float> soft = normalised(window(0, 0.2F)), hard = normalised(window(0, 0.8F));
  for (std::size_t i = 0; i < soft.size(); ++i) EXPECT_NEAR(soft[i], hard[i], kStep / 0.2F) << i;
}

// Pressed hard on a flat plate: a small swing upon a large rest is no texture at full gain.
TEST(NormaliseWindow, ASmallSwingOnALargeRestStaysSmall) {
  const std::vector<float> x = normalised(window(0.8F, 0.04F));
  EXPECT_NEAR(x[10 * kChannels] - x[0], 0.04F / 0.44F, 2 * kStep);
}

TEST(NormaliseWindow, AQuietWindowIsNotMadeLouder) {
  const std::vector<float> x = normalised(window(0, 0.03F));
  EXPECT_FLOAT_EQ(x[10 * kChannels], 0.03F / kLeastGain);
  for (const float value : normalised(std::vector<float>(kTimes * kChannels, 0))) EXPECT_EQ(value, 0);
}

TEST(NormaliseWindow, TwoGlitchesDoNotSetTheGain) {
  std::vector<float> x = window(0, 0.25F);
  const std::vector<float> clean = normalised(x);
  x[3 * kChannels] = x[47 * kChannels] = 1;
  const std::vector<float> glitchy = normalised(x);
  EXPECT_EQ(glitchy[3 * kChannels], 1);
  for (std::size_t t = 0; t < kTimes; ++t) {
    if (t == 3 || t == 47) continue;
    EXPECT_EQ(glitchy[t * kChannels], clean[t * kChannels]) << t;
  }
}

TEST(NormaliseWindow, SaturatedDeadAndShortWindowsStayInRange) {
  for (const float value : {0.0F, 0.5F, 1.0F}) {
    for (const std::size_t frames : {std::size_t{1}, std::size_t{2}, std::size_t{512}}) {
      std::vector<float> x(frames * kChannels, value);
      normalise_window(x, kChannels);
      for (const float y : x) ASSERT_TRUE(y >= 0 && y <= 1) << value << " x " << frames << ": " << y;
    }
  }
}

// It was counted beside the bins.
TEST(NormaliseWindow, NanStaysWhereItIs) {
  std::vector<float> broken(2 * 64);
  for (std::size_t i = 0; i < broken.size(); ++i) broken[i] = static_cast<float>(i) / 128;
  broken[7] = NAN;
  normalise_window(broken, 2);
  for (std::size_t i = 0; i < broken.size(); ++i)
    ASSERT_TRUE(i == 7 || (broken[i] >= 0 && broken[i] <= 1)) << i;
}

TEST(NormaliseWindow, RefusesWhatIsNoWindow) {
  for (const auto& [values, taxels] :
       {std::pair(7, 2), {7, 0}, {0, 2}, {65'536, 1}}) {  // counts would not fit
    std::vector<float> x(static_cast<std::size_t>(values));
    EXPECT_EQ(what_of<std::invalid_argument>([&] { normalise_window(x, static_cast<std::size_t>(taxels)); }),
              "normalise_window: a window is [T][" + std::to_string(taxels) + "], T up to 65535, got " +
                  std::to_string(values) + " values");
  }
}

}  // namespace supertac::normalise_window_test
