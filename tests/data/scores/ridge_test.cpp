#include "data/scores/ridge.h"

#include <gtest/gtest.h>
#include <omp.h>

#include <algorithm>
#include <cstring>

#include "data/windows/split.h"
#include "io/numbers/random.h"
#include "tests/data/test_recordings.h"
#include "tests/expect_error.h"

namespace supertac {
namespace {

constexpr int kSteps = 16;

// Signals that hold the surface under each row of taxels, and noise.
WindowSet make_set(double noise, int passes = 5) {
  WindowSet set(wide_settings(kSteps));
  const Plate plate = Plate::named("bumps12");
  for (int pass = 1; pass <= passes; ++pass) {
    Recording recording = make_recording({.plate = "bumps12", .pass = pass, .frames = 900, .start_y_mm = 40});
    const RandomStream random(static_cast<std::uint64_t>(pass), 0);
    for (std::size_t i = 0; i < recording.frames(); ++i) {
      const double y = recording.position_mm[2 * i + 1];
      for (std::size_t k = 0; k < kTaxels; ++k) {
        const double height = plate.height(18, y - 4.5 + 3 * static_cast<double>(k / 4)) / plate.max_height();
        const double level = 0.3 + 0.4 * height + noise * random.normal(i * kTaxels + k);
        recording.volts[i * kTaxels + k] = static_cast<float>(3 - 2 * level);
      }
    }
    set.add(recording);
  }
  return set;
}

double error_of(const WindowSet& set, const std::vector<std::uint32_t>& indices, const Baseline& baseline) {
  std::vector<float> out(256), truth(256);
  double sum = 0;
  for (const std::uint32_t i : indices) {
    baseline.predict(set.window(i), out);
    set.truth(i, truth);
    for (std::size_t p = 0; p < 256; ++p) sum += (out[p] - truth[p]) * (out[p] - truth[p]);
  }
  return sum / 256 / static_cast<double>(indices.size());
}

TEST(Ridge, UsesWhatTheWindowHoldsBetterThanTheLastFrame) {
  const WindowSet set = make_set(0.01);
  const Split split = make_split(set, SplitKind::pass, 1);
  const Ridge ridge(set, split.train);
  EXPECT_EQ(ridge.name(), "ridge");
  EXPECT_LT(error_of(set, split.test, ridge),
            0.5 * error_of(set, split.test, UpsampledFrame(Upsampling::Kind::bicubic, set, split.train)));
}

TEST(Ridge, SaysHowFarItIsAndCanBeEnded) {
  const WindowSet set = make_set(0.01);
  const auto train = make_split(set, SplitKind::none, 1).train;
  std::size_t last = 0, all = 0;
  const Ridge whole(set, train, [&](std::size_t done, std::size_t parts) {
    EXPECT_EQ(done, last + 1);
    last = done, all = parts;
  });
  EXPECT_EQ(last, all);
  for (const std::size_t at : {std::size_t{1}, all / 2, all}) {
    const auto stop = [at](std::size_t done, std::size_t) {
      if (done == at) throw std::runtime_error("ended");
    };
    EXPECT_EQ(what_of<std::runtime_error>([&] { Ridge(set, train, stop); }), "ended") << at;
  }
}

TEST(Ridge, IsLinearInTheWindow) {
  const WindowSet set = make_set(0);
  const auto train = make_split(set, SplitKind::none, 1).train;
  const Ridge ridge(set, train);
  EXPECT_DOUBLE_EQ(ridge.penalty(), 1e-5) << "nothing to guard against without noise";
  std::vector<float> a(256), b(256), middle(256), window(kSteps * kTaxels);
  ridge.predict(set.window(10), a);
  ridge.predict(set.window(500), b);
  for (std::size_t i = 0; i < window.size(); ++i) window[i] = (set.window(10)[i] + set.window(500)[i]) / 2;
  ridge.predict(window, middle);
  for (std::size_t p = 0; p < 256; ++p) ASSERT_NEAR(middle[p], (a[p] + b[p]) / 2, 1e-4);
}

TEST(Ridge, NoiseRaisesThePenalty) {
  const auto penalty = [](double noise) {
    const WindowSet set = make_set(noise);
    return Ridge(set, make_split(set, SplitKind::none, 1).train).penalty();
  };
  EXPECT_GT(penalty(0.2), penalty(0));
}

TEST(Ridge, OnePassIsEnoughAndADeadArrayGivesTheMean) {
  const WindowSet one = make_set(0.01, 1);
  EXPECT_LT(error_of(one, {5, 300}, Ridge(one, make_split(one, SplitKind::none, 1).train)), 0.02);
  Recording rest = make_recording({.frames = 300, .start_y_mm = 50});
  std::fill(rest.volts.begin(), rest.volts.end(), 3.0F);
  WindowSet set(wide_settings(kSteps));
  set.add(rest);
  const auto train = make_split(set, SplitKind::none, 1).train;
  const MeanImage mean(set, train);
  EXPECT_NEAR(error_of(set, train, Ridge(set, train)), error_of(set, train, mean), 1e-6);
}

// W solves the normal equations: their residual X'(X W - Y) is the penalty's part of them. Asked of the
// pictures: over the windows that it was fitted to, what is left of each pixel has no mean.
TEST(Ridge, LeavesNoMeanError) {
  const WindowSet set = make_set(0.05);
  const auto train = make_split(set, SplitKind::none, 1).train;
  const Ridge ridge(set, train);
  std::vector<float> out(256), truth(256);
  std::vector<double> sum(256);
  for (const std::uint32_t i : train) {
    ridge.predict(set.window(i), out);
    set.truth(i, truth);
    for (std::size_t p = 0; p < 256; ++p) sum[p] += out[p] - truth[p];
  }
  for (const double s : sum) EXPECT_NEAR(s / static_cast<double>(train.size()), 0, 1e-5);
}

TEST(Ridge, DoesNotDependOnTheNumberOfThreads) {
  const WindowSet set = make_set(0);
  const auto train = make_split(set, SplitKind::none, 1).train;
  const int before = omp_get_max_threads();
  std::vector<float> pictures[2];
  for (const int threads : {1, 2}) {
    omp_set_num_threads(threads);
    const Ridge ridge(set, train);
    std::vector<float> out(256);
    for (std::size_t i = 0; i < set.size(); ++i) {
      ridge.predict(set.window(i), out);
      pictures[threads - 1].insert(pictures[threads - 1].end(), out.begin(), out.end());
    }
  }
  omp_set_num_threads(before);
  EXPECT_EQ(std::memcmp(pictures[0].data(), pictures[1].data(), pictures[0].size() * sizeof(float)), 0);
}

TEST(Ridge, RefusesNoWindowsAndOtherSizes) {
  const WindowSet set = make_set(0.01, 1);
  EXPECT_EQ(what_of<std::invalid_argument>([&] { Ridge(set, {}); }), "ridge: there is no window to fit to");
  const Ridge ridge(set, make_split(set, SplitKind::none, 1).train);
  std::vector<float> out(256), small(64);
  EXPECT_EQ(what_of<std::invalid_argument>([&] { ridge.predict(std::vector<float>(8 * kTaxels), out); }),
            "ridge: expects a window [16][16] and 256 pixels, got 128 and 256 values");
  EXPECT_EQ(what_of<std::invalid_argument>([&] { ridge.predict(set.window(0), small); }),
            "ridge: expects a window [16][16] and 256 pixels, got 256 and 64 values");
}

}  // namespace
}  // namespace supertac
