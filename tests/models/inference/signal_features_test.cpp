#include "models/inference/novelty.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "tests/expect_error.h"

namespace supertac {
namespace {

constexpr std::size_t kLength = 64;

// A bump that runs from row to row, `lag` frames later each, over all columns.
std::vector<float> running(double lag) {
  std::vector<float> window;
  for (std::size_t t = 0; t < kLength; ++t)
    for (std::size_t k = 0; k < 16; ++k) {
      const double d = (static_cast<double>(t) - 10 - lag * static_cast<double>(k / 4)) / 5;
      window.push_back(static_cast<float>(0.2 + 0.5 * std::exp(-d * d)));
    }
  return window;
}

TEST(SignalFeatures, AreMeansAndLogarithmsOfSwings) {
  std::vector<float> window(kLength * 16, 0.25F);
  for (std::size_t t = 0; t < kLength; ++t) window[16 * t + 3] = t % 2 == 0 ? 0.4F : 0.6F;
  const std::vector<float> features = signal_features(window, TaxelArray{});
  ASSERT_EQ(features.size(), 35U);
  EXPECT_FLOAT_EQ(features[0], 0.25F);
  EXPECT_NEAR(features[3], 0.5, 1e-6);
  EXPECT_NEAR(features[16], std::log(0.0005), 1e-5);
  EXPECT_NEAR(features[16 + 3], std::log(0.1005), 1e-5);
}

TEST(SignalFeatures, TellWhichRowComesFirst) {
  const std::vector<float> on = signal_features(running(8), TaxelArray{}),
                           back = signal_features(running(-8), TaxelArray{}),
                           still = signal_features(running(0), TaxelArray{});
  for (std::size_t r = 32; r < 35; ++r) {
    EXPECT_GT(on[r], 0.3);
    EXPECT_NEAR(still[r], 0, 1e-5);
  }
  EXPECT_LT(back[32], -0.3);
}

TEST(SignalFeatures, OfSilenceAreFinite) {
  const std::vector<float> none(kLength * 16);
  for (const float f : signal_features(none, TaxelArray{})) EXPECT_TRUE(std::isfinite(f));
}

TEST(SignalFeatures, FollowTheArray) {
  const TaxelArray array{.rows = 3, .columns = 5, .channels = 2};
  const std::vector<float> window(kLength * array.signals(), 0.5F);
  EXPECT_EQ(signal_features(window, array).size(), 2U * 30 + 2);
}

TEST(SignalFeatures, RefuseAPieceOfAFrame) {
  const std::vector<float> piece(16 * 16 - 1), short_one(15 * 16);
  EXPECT_EQ(what_of<std::invalid_argument>([&] { signal_features(piece, TaxelArray{}); }),
            "signal features: expects 16 or more frames of 16 and room for 35, got 255 and 35");
  EXPECT_EQ(what_of<std::invalid_argument>([&] { signal_features(short_one, TaxelArray{}); }),
            "signal features: expects 16 or more frames of 16 and room for 35, got 240 and 35");
}

}  // namespace
}  // namespace supertac
