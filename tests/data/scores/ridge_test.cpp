#include "data/scores/baselines.h"

#include <omp.h>

#include "data/windows/split.h"
#include "tests/data/scores/surface_windows.h"
#include "tests/support/test.h"

namespace supertac::ridge_test {

constexpr int kSteps = 16;

WindowSet make_ridge_set(double noise, int passes = 5) { return surface_windows(0.3, 0.4, noise, passes); }

TEST(Ridge, UsesWhatTheWindowHoldsBetterThanTheLastFrame) {
  const WindowSet set = make_ridge_set(0.01);
  const Split split = make_split(set, SplitKind::pass, 1);
  const Ridge ridge(set, split.train);
  EXPECT_EQ(ridge.name(), "ridge");
  EXPECT_LT(mean_error(set, split.test, ridge),
            0.5 * mean_error(set, split.test, UpsampledFrame(set, split.train)));
}

TEST(Ridge, SaysHowFarItIsAndCanBeEnded) {
  const WindowSet set = make_ridge_set(0.01);
  const auto train = all_of(set);
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
  const WindowSet set = make_ridge_set(0);
  const auto train = all_of(set);
  const Ridge ridge(set, train);
  EXPECT_DOUBLE_EQ(ridge.penalty(), 1e-5) << "nothing to guard against without noise";
  std::vector<float> a(256), b(256), middle(256), window(kSteps * rig::kTaxels);
  ridge.predict(set.window(10), a);
  ridge.predict(set.window(500), b);
  for (std::size_t i = 0; i < window.size(); ++i) window[i] = (set.window(10)[i] + set.window(500)[i]) / 2;
  ridge.predict(window, middle);
  for (std::size_t p = 0; p < 256; ++p) ASSERT_NEAR(middle[p], (a[p] + b[p]) / 2, 1e-4);
}

TEST(Ridge, NoiseRaisesThePenalty) {
  const auto penalty = [](double noise) {
    const WindowSet set = make_ridge_set(noise);
    return Ridge(set, all_of(set)).penalty();
  };
  EXPECT_GT(penalty(0.2), penalty(0));
}

TEST(Ridge, OnePassIsEnoughAndADeadArrayGivesTheMean) {
  const WindowSet one = make_ridge_set(0.01, 1);
  EXPECT_LT(mean_error(one, {5, 300}, Ridge(one, all_of(one))), 0.02);
  Recording rest = make_recording({.frames = 300, .start_y_mm = 50});
  std::fill(rest.signals.begin(), rest.signals.end(), 3.0F);
  WindowSet set(wide_settings(kSteps));
  set.add(rest);
  const auto train = all_of(set);
  const MeanImage mean(set, train);
  EXPECT_NEAR(mean_error(set, train, Ridge(set, train)), mean_error(set, train, mean), 1e-6);
}

// W solves the normal equations: their residual X'(X W - Y) is the penalty's part of them. Asked of the
// pictures: over the windows that it was fitted to, what is left of each pixel has no mean.
TEST(Ridge, LeavesNoMeanError) {
  const WindowSet set = make_ridge_set(0.05);
  const auto train = all_of(set);
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
  const WindowSet set = make_ridge_set(0);
  const auto train = all_of(set);
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

TEST(Ridge, RefusesNoWindows) {
  EXPECT_EQ(what_of<std::invalid_argument>([&] { Ridge(make_ridge_set(0.01, 1), {}); }),
            "ridge: there is no window to fit to");
}

}  // namespace supertac::ridge_test
