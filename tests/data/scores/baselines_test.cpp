#include "data/scores/baselines.h"

#include <omp.h>

#include "data/windows/split.h"
#include "io/numbers/random.h"
#include "tests/data/test_recordings.h"
#include "tests/support/test.h"

namespace supertac::baselines_test {

// Passes over 12 mm bumps in which each taxel, scaled, shows base + per_height times the height (0 to 1)
// under its row, and noise of that deviation.
WindowSet surface_windows(double base, double per_height, double noise = 0, int passes = 1) {
  WindowSet set(wide_settings());
  const Plate plate = Plate::named("bumps12");
  for (int pass = 1; pass <= passes; ++pass) {
    Recording recording = make_recording({.plate = "bumps12", .pass = pass, .frames = 900, .start_y_mm = 40});
    const RandomStream random(static_cast<std::uint64_t>(pass), 0);
    for (std::size_t i = 0; i < recording.signals.size(); ++i) {
      const double y = recording.position_mm[2 * (i / rig::kTaxels) + 1];
      const double row_mm = -4.5 + 3 * static_cast<double>(i % rig::kTaxels / 4);
      const double height = plate.height(18, y + row_mm) / plate.max_height();
      recording.signals[i] =
          static_cast<float>(3 - 2 * (base + per_height * height + noise * random.normal(i)));
    }
    set.add(recording);
  }
  return set;
}

double mean_error(const WindowSet& set, const std::vector<std::uint32_t>& indices, const Baseline& baseline) {
  std::vector<float> out(256), truth(256);
  double sum = 0;
  for (const std::uint32_t i : indices) {
    baseline.predict(set.raw_window(i), out);
    set.truth(i, truth);
    for (std::size_t p = 0; p < 256; ++p) sum += (out[p] - truth[p]) * (out[p] - truth[p]);
  }
  return sum / 256 / static_cast<double>(indices.size());
}

std::vector<float> upsampled(const std::vector<float>& frame) {
  std::vector<float> out(256);
  bicubic_enlargement(4, 4, 4)(frame, out);
  return out;
}

// x and y (mm) of the centre of pixel i of 16.
double centre(std::size_t i) { return -6 + (static_cast<double>(i) + 0.5) * 0.75; }

std::vector<float> ramp(double per_x, double per_y) {
  std::vector<float> frame(16);
  for (std::size_t k = 0; k < 16; ++k) {
    const double x = -4.5 + 3.0 * static_cast<double>(k % 4), y = -4.5 + 3.0 * static_cast<double>(k / 4);
    frame[k] = static_cast<float>(per_x * x + per_y * y);
  }
  return frame;
}

// Rows grow with y and columns with x, and pixels sit where the truth image says they do.
TEST(Bicubic, ReproducesARampBetweenTheTaxels) {
  const auto flat = upsampled(std::vector<float>(16, 0.7F)), along_x = upsampled(ramp(1, 0)),
             along_y = upsampled(ramp(0, 1));
  for (std::size_t r = 0; r < 16; ++r) {
    for (std::size_t c = 0; c < 16; ++c) EXPECT_NEAR(flat[r * 16 + c], 0.7, 1e-6);
    for (std::size_t c = 6; c < 10; ++c) {  // where all four taxels of the kernel exist
      EXPECT_NEAR(along_x[r * 16 + c], centre(c), 1e-5);
      EXPECT_NEAR(along_y[c * 16 + r], centre(c), 1e-5);
    }
  }
}

TEST(Bicubic, HasKeysWeights) {
  // Row 7 of 16: u = 7.5/4 - 0.5 = 1.375; a lone taxel in row 1 weighs k(0.375) there.
  std::vector<float> frame(16, 0.0F);
  for (std::size_t c = 0; c < 4; ++c) frame[4 + c] = 1;
  const double d = 0.375;
  EXPECT_NEAR(upsampled(frame)[7 * 16 + 5], 1.5 * d * d * d - 2.5 * d * d + 1, 1e-6);
}

TEST(Bicubic, TakesArraysOfAnyShape) {
  const std::vector<float> frame = {1, 2, 3, 4, 5, 6};  // 2 rows of 3
  std::vector<float> bicubic(24);
  bicubic_enlargement(2, 3, 2)(frame, bicubic);
  for (std::size_t r = 0; r < 4; ++r)
    for (std::size_t c = 0; c < 6; ++c)
      EXPECT_NEAR(bicubic[r * 6 + c], frame[(r / 2) * 3 + c / 2], 1.2) << r << " " << c;
  EXPECT_LT(bicubic[0], bicubic[5]);
  EXPECT_LT(bicubic[0], bicubic[18]);
}

// The least-squares line is shrunk below 1 / 0.5 because bicubic misses part of the shape.
TEST(Baselines, UndoTheScaleOfTheSignal) {
  const WindowSet set = surface_windows(0.2, 0.5);
  const Baseline bicubic = upsampled_frame(set, all_of(set));
  std::vector<float> flat(256), higher(256);
  bicubic.predict(std::vector<float>(16 * 16, 0.2F), flat);
  bicubic.predict(std::vector<float>(16 * 16, 0.3F), higher);
  EXPECT_NEAR(flat[100], 0, 0.15);
  EXPECT_NEAR((higher[100] - flat[100]) / 0.1F, 1.6, 0.45);
}

TEST(Baselines, AreOrderedOnASignalThatShowsTheSurface) {
  const WindowSet set = surface_windows(0.2, 0.5);
  const auto baselines = fit_baselines(set, all_of(set));
  std::vector<std::string> names;
  for (const Baseline& baseline : baselines) names.push_back(baseline.name);
  ASSERT_EQ(names, (std::vector<std::string>{"mean_image", "bicubic", "ridge"}));
  const auto error = [&](std::size_t i) { return mean_error(set, all_of(set), baselines[i]); };
  EXPECT_LT(error(1), 0.5 * error(0));
  // All but ridge see the last frame only.
  const std::vector<float> window = set.raw_window(200);
  std::vector<float> out(256), again(256), changed = window;
  std::fill(changed.begin(), changed.end() - 16, 0.0F);
  for (const Baseline& baseline : baselines) {
    baseline.predict(window, out);
    baseline.predict(changed, again);
    EXPECT_EQ(out == again, baseline.name != "ridge") << baseline.name;
  }
}

TEST(Baselines, MeanImageIsTheMeanTruthWhateverItSees) {
  const WindowSet set = surface_windows(0.2, 0.5);
  const std::vector<std::uint32_t> train{3, 400};
  std::vector<float> out(256), a(256), b(256);
  mean_image(set, train).predict(set.raw_window(0), out);
  set.truth(3, a);
  set.truth(400, b);
  for (std::size_t p = 0; p < 256; ++p) ASSERT_NEAR(out[p], (a[p] + b[p]) / 2, 1e-6);
}

WindowSet resting(float volts) {
  Recording rest = make_recording({.frames = 300, .start_y_mm = 50});
  std::fill(rest.signals.begin(), rest.signals.end(), volts);
  WindowSet set(wide_settings(16));
  set.add(rest);
  return set;
}

TEST(Baselines, ASignalThatNeverChangesGivesTheMean) {
  const WindowSet set = resting(2.4F);
  const auto train = all_of(set);
  const double mean = mean_error(set, train, mean_image(set, train));
  std::vector<float> still(256), other(256);
  const Baseline bicubic = upsampled_frame(set, train);
  bicubic.predict(set.raw_window(0), still);
  bicubic.predict(std::vector<float>(256, 0.5F), other);
  EXPECT_EQ(still, other);
  EXPECT_GT(still[0], 0);
  const WindowSet dead = resting(3);
  EXPECT_NEAR(mean_error(dead, train, ridge(dead, train)), mean, 1e-6);
}

TEST(Baselines, NeedWindowsToFitToAndTheirSizes) {
  const WindowSet set = surface_windows(0.2, 0.5);
  EXPECT_REFUSAL("baseline: train expects a window or more, got none", fit_baselines(set, {}));
  EXPECT_REFUSAL("baseline: train expects a window or more, got none", ridge(set, {}));
  std::vector<float> out(256), small(64);
  for (const Baseline& baseline : fit_baselines(set, all_of(set))) {
    EXPECT_REFUSAL(baseline.name == "ridge" ? "baseline: window expects 256 values, got 15"
                                            : "baseline: window expects [T][16], got 15 values",
                   baseline.predict(std::vector<float>(15), out));
    EXPECT_REFUSAL("baseline: image expects 256 values, got 64", baseline.predict(set.raw_window(0), small));
  }
  EXPECT_REFUSAL("baseline: frame expects 16 values, got 15",
                 bicubic_enlargement(4, 4, 4)(std::vector<float>(15), out));
}

WindowSet make_ridge_set(double noise, int passes = 5) { return surface_windows(0.3, 0.4, noise, passes); }

TEST(Ridge, UsesWhatTheWindowHoldsBetterThanTheLastFrame) {
  const WindowSet set = make_ridge_set(0.01);
  const Split split = make_split(set, SplitKind::pass, 1);
  EXPECT_LT(mean_error(set, split.test, ridge(set, split.train)),
            0.5 * mean_error(set, split.test, upsampled_frame(set, split.train)));
}

TEST(Ridge, SaysHowFarItIsAndCanBeEnded) {
  const WindowSet set = make_ridge_set(0.01);
  const auto train = all_of(set);
  std::size_t last = 0, all = 0;
  ridge(set, train, [&](std::size_t done, std::size_t parts) {
    EXPECT_EQ(done, last + 1);
    last = done, all = parts;
  });
  EXPECT_EQ(last, all);
  for (const std::size_t at : {std::size_t{1}, all / 2, all}) {
    const auto stop = [at](std::size_t done, std::size_t) {
      if (done == at) throw std::runtime_error("ended");
    };
    EXPECT_EQ(what_of<std::runtime_error>([&] { ridge(set, train, stop); }), "ended") << at;
  }
}

TEST(Ridge, IsLinearInTheWindow) {
  const WindowSet set = make_ridge_set(0);
  const Baseline baseline = ridge(set, all_of(set));
  std::vector<float> a(256), b(256), middle(256), window(16 * rig::kTaxels);
  baseline.predict(set.raw_window(10), a);
  baseline.predict(set.raw_window(500), b);
  for (std::size_t i = 0; i < window.size(); ++i)
    window[i] = (set.raw_window(10)[i] + set.raw_window(500)[i]) / 2;
  baseline.predict(window, middle);
  for (std::size_t p = 0; p < 256; ++p) ASSERT_NEAR(middle[p], (a[p] + b[p]) / 2, 1e-4);
}

// With the least penalty the noise of few windows would be learned by heart (0.35 instead of 0.16).
TEST(Ridge, NoiseRaisesThePenalty) {
  const WindowSet set = make_ridge_set(0.3);
  const Split split = make_split(set, SplitKind::pass, 1);
  const auto few = evenly_spaced(split.train, 400);
  EXPECT_LT(mean_error(set, split.test, ridge(set, few)),
            0.25 * mean_error(set, split.test, mean_image(set, few)));
}

TEST(Ridge, OnePassIsEnough) {
  const WindowSet one = make_ridge_set(0.01, 1);
  EXPECT_LT(mean_error(one, {5, 300}, ridge(one, all_of(one))), 0.02);
}

// W solves the normal equations: their residual X'(X W - Y) is the penalty's part of them. Asked of the
// pictures: over the windows that it was fitted to, what is left of each pixel has no mean.
TEST(Ridge, LeavesNoMeanError) {
  const WindowSet set = make_ridge_set(0.05);
  const auto train = all_of(set);
  const Baseline baseline = ridge(set, train);
  std::vector<float> out(256), truth(256);
  std::vector<double> sum(256);
  for (const std::uint32_t i : train) {
    baseline.predict(set.raw_window(i), out);
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
    const Baseline baseline = ridge(set, train);
    std::vector<float> out(256);
    for (std::size_t i = 0; i < set.size(); ++i) {
      baseline.predict(set.raw_window(i), out);
      pictures[threads - 1].insert(pictures[threads - 1].end(), out.begin(), out.end());
    }
  }
  omp_set_num_threads(before);
  EXPECT_EQ(std::memcmp(pictures[0].data(), pictures[1].data(), pictures[0].size() * sizeof(float)), 0);
}

}  // namespace supertac::baselines_test
