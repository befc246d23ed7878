#include "data/windows/transforms.h"

#include "tests/support/test.h"

namespace supertac::transforms_test {

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
TEST(NormaliseWindow, RestAndTopAreTheStatedSamples) {
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

// Without care its bin would lie beside all others.
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
    EXPECT_REFUSAL("normalise_window: window expects [T][" + std::to_string(taxels) +
                       "] with T from 1 to 65535, got " + std::to_string(values) + " values",
                   normalise_window(x, static_cast<std::size_t>(taxels)));
  }
}

constexpr std::size_t kFrames = 256;

std::vector<float> changed(const AugmentSettings& settings, std::uint64_t sample, float level = 0.5F) {
  std::vector<float> window(kFrames * 16, level);
  augment(settings, 1, sample, window);
  return window;
}

// Highest and lowest value over taxels and samples 0..199 of frame 0.
std::pair<float, float> range(const AugmentSettings& settings, float level) {
  float low = 1, high = 0;
  for (std::uint64_t sample = 0; sample < 200; ++sample) {
    const auto window = changed(settings, sample, level);
    low = std::min(low, *std::min_element(window.begin(), window.end()));
    high = std::max(high, *std::max_element(window.begin(), window.end()));
  }
  return {low, high};
}

TEST(Augment, OffChangesNothing) { EXPECT_EQ(changed({}, 3), std::vector<float>(kFrames * 16, 0.5F)); }

TEST(Augment, GainIsOneFactorPerWindow) {
  const AugmentSettings settings{.gain = 0.5};
  const auto window = changed(settings, 3);
  EXPECT_EQ(*std::min_element(window.begin(), window.end()), *std::max_element(window.begin(), window.end()));
  EXPECT_NE(window, changed(settings, 4));
  const auto [low, high] = range(settings, 0.6F);
  EXPECT_NEAR(low, 0.6 / 1.5, 0.01);
  EXPECT_NEAR(high, 0.9, 0.01);
}

TEST(Augment, LiftTakesTheSameFromEverySignalAndEndsAtRest) {
  const AugmentSettings settings{.lift = 0.4};
  float least = 1;
  for (std::uint64_t sample = 0; sample < 200; ++sample) {
    std::vector<float> window(kFrames * 16, 0.5F);
    for (std::size_t i = 0; i < window.size(); i += 16) window[i] = 0.1F, window[i + 1] = 0.9F;
    augment(settings, 1, sample, window);
    const float lift = 0.5F - window[2];
    ASSERT_GE(lift, 0);
    EXPECT_NEAR(window[1], 0.9F - lift, 1e-6);
    EXPECT_NEAR(window[0], std::max(0.1F - lift, 0.0F), 1e-6);
    for (std::size_t i = 16; i < window.size(); ++i) ASSERT_EQ(window[i], window[i - 16]);
    least = std::min(least, window[2]);
  }
  EXPECT_NEAR(least, 0.1, 0.01);
}

TEST(Augment, TaxelGainAndOffsetAreConstantInTime) {
  for (const AugmentSettings& settings :
       {AugmentSettings{.taxel_gain = 0.2}, AugmentSettings{.offset = 0.1}}) {
    const auto window = changed(settings, 3);
    std::set<float> values(window.begin(), window.begin() + 16);
    EXPECT_EQ(values.size(), 16U);
    for (std::size_t i = 16; i < window.size(); ++i) ASSERT_EQ(window[i], window[i - 16]);
  }
  const auto [low, high] = range({.offset = 0.1}, 0.5F);
  EXPECT_NEAR(low, 0.4, 1e-3);
  EXPECT_NEAR(high, 0.6, 1e-3);
}

TEST(Augment, DropsNoneToAllAllowedTaxelsAndEachEquallyOften) {
  int taxels_dropped[4] = {}, of_taxel[16] = {};
  for (std::uint64_t sample = 0; sample < 8000; ++sample) {
    const auto window = changed({.dropped = 3}, sample);
    const auto zeros = std::count(window.begin(), window.begin() + 16, 0.0F);
    ASSERT_LE(zeros, 3);
    ASSERT_EQ(std::count(window.begin(), window.end(), 0.0F), zeros * static_cast<long>(kFrames));
    ++taxels_dropped[zeros];
    for (std::size_t k = 0; k < 16; ++k) of_taxel[k] += window[k] == 0 ? 1 : 0;
  }
  for (const int count : taxels_dropped) EXPECT_NEAR(count, 2000, 170);
  for (const int count : of_taxel) EXPECT_NEAR(count, 8000 * 1.5 / 16, 120);
}

TEST(Augment, NoiseHasTheStatedDeviationAndNoMemory) {
  const auto window = changed({.noise = 0.05}, 3);
  double sum = 0, squares = 0, product = 0;
  for (std::size_t i = 0; i < window.size(); ++i) {
    const double v = window[i] - 0.5;
    sum += v;
    squares += v * v;
    if (i >= 16) product += v * (window[i - 16] - 0.5);
  }
  const auto n = static_cast<double>(window.size());
  EXPECT_NEAR(sum / n, 0, 4 * 0.05 / std::sqrt(n));
  EXPECT_NEAR(std::sqrt(squares / n), 0.05, 0.002);
  EXPECT_NEAR(product / squares, 0, 4 / std::sqrt(n));
}

TEST(Augment, IsAPureFunctionOfSeedAndSample) {
  const AugmentSettings settings{
      .lift = 0.2, .gain = 0.3, .taxel_gain = 0.1, .offset = 0.05, .noise = 0.02, .dropped = 2};
  EXPECT_EQ(changed(settings, 3), changed(settings, 3));
  EXPECT_NE(changed(settings, 3), changed(settings, 4));
  std::vector<float> other(kFrames * 16, 0.5F);
  augment(settings, 2, 3, other);
  EXPECT_NE(other, changed(settings, 3));
}

TEST(Augment, StaysInRange) {
  const auto [low, high] = range({.gain = 3, .taxel_gain = 1, .offset = 0.5, .noise = 1}, 0.7F);
  EXPECT_EQ(low, 0);
  EXPECT_EQ(high, 1);
}

TEST(Augment, RefusesNegativeMagnitudes) {
  const auto message = [](const AugmentSettings& settings) {
    return what_of<std::invalid_argument>([&] { check(settings); });
  };
  EXPECT_EQ(message({.gain = -1}), "augmentation: gain expects 0 (off) or more, got -1");
  EXPECT_EQ(message({.noise = std::numeric_limits<double>::quiet_NaN()}),
            "augmentation: noise expects 0 (off) or more, got nan");
  EXPECT_EQ(message({.dropped = 17}), "augmentation: dropped expects 0 to 16, got 17");
  EXPECT_EQ(message({.dropped = -1}), "augmentation: dropped expects 0 to 16, got -1");
  std::vector<float> window(17);
  EXPECT_REFUSAL("augment: window expects [T][16] of 4x4 taxels at 3 mm, got 17 values",
                 augment({.gain = 1}, 1, 1, window));
  EXPECT_NO_THROW(check(AugmentSettings{}));
}

// More signals than the rig has: every term has numbers of its own, and a dropped taxel loses all channels.
TEST(Augment, AnyArray) {
  const TaxelArray array{.rows = 3, .columns = 5, .channels = 3};
  std::set<float> levels;
  std::size_t dropped = 0;
  for (std::uint64_t sample = 0; sample < 50; ++sample) {
    std::vector<float> window(8 * array.signals(), 0.5F);
    augment({.gain = 0.5, .taxel_gain = 0.3, .offset = 0.02, .dropped = 2}, 1, sample, window, array);
    for (std::size_t k = 0; k < array.signals(); k += 3) {
      const bool silent = window[k] == 0;
      dropped += silent;
      for (std::size_t c = 0; c < 3; ++c) EXPECT_EQ(window[k + c] == 0, silent);
    }
    for (std::size_t k = 0; k < array.signals(); ++k) {
      levels.insert(window[k]);
      EXPECT_EQ(window[7 * array.signals() + k], window[k]);
    }
  }
  EXPECT_NEAR(static_cast<double>(dropped), 50, 20);
  EXPECT_GT(levels.size(), 1800U);  // of 2250, some of which are clipped or dropped
  std::vector<float> window(array.signals());
  EXPECT_REFUSAL("augmentation: dropped expects 0 to 15, got 16",
                 augment({.dropped = 16}, 1, 1, window, array));
  EXPECT_REFUSAL("augment: window expects [T][45] of 3x5 taxels at 3 mm with 3 channels, got 44 values",
                 augment({.gain = 1}, 1, 1, std::span(window).first(44), array));
}

}  // namespace supertac::transforms_test
