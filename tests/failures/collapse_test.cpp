// Failures 1, 2 and 4: the network stops to look at its input, and the loss falls all the same.
#include <omp.h>

#include "autograd/ops/activations.h"
#include "autograd/ops/losses.h"
#include "tests/models/support.h"
#include "tests/support/test.h"

namespace supertac::collapse_test {

class CollapseTest : public ::testing::Test {
 protected:
  CollapseTest() { omp_set_num_threads(1); }
  ~CollapseTest() override { omp_set_num_threads(before_); }

  Recipe settings = small_training();
  WindowSet windows = small_windows(small_settings());

  struct End {
    bool collapsed = false, stopped = false;
    int active_latents = 0;
    double difference = 0, decoded = 0;  // of two windows' pictures and decoded signals, root mean square
  };
  End train(const Recipe& s) {
    Trainer trainer(windows, all_of(windows), s);
    StepReport report;
    try {
      while (!trainer.done() && !report.collapsed) report = trainer.train_step();
    } catch (const TrainingStopped&) {
      return {.stopped = true};
    }
    std::array<Tensor, kGroups> eps;
    eps.fill(Tensor::zeros({2, settings.model.latent}));
    const SuperTac::Output output = trainer.model().forward(two_windows(), eps);
    return {report.collapsed, false, report.active_latents, difference(output.picture.value()),
            difference(output.decoded[3].value())};
  }

 private:
  Tensor two_windows() const {
    Tensor two(Shape{2, static_cast<Dim>(windows.frames()), rig::kTaxels});
    const auto half = static_cast<std::size_t>(two.size() / 2);
    windows.window(0, two.values().first(half));
    windows.window(windows.size() / 4, two.values().last(half));
    return two;
  }
  static double difference(const Tensor& pair) {
    const Dim half = pair.size() / 2;
    double sum = 0;
    for (Dim i = 0; i < half; ++i)
      sum += std::pow(static_cast<double>(pair.data()[i] - pair.data()[half + i]), 2);
    return std::sqrt(sum / static_cast<double>(half));
  }
  int before_ = omp_get_max_threads();
};

// A saturated sigmoid behind the last layer passes no gradient, so that an all-zero picture stays one; the
// linear output of this network passes all of it.
TEST_F(CollapseTest, F1LinearOutputHasNoFlatSpot) {
  const auto gradient = [](bool with_sigmoid) {
    const Variable x(Tensor::full({1, 8, 8, 1}, with_sigmoid ? -20 : 0), true);
    backward(l2_loss(with_sigmoid ? sigmoid(x) : x, Variable(uniform({1, 8, 8, 1}, 3))));
    return std::abs(static_cast<double>(x.grad().data()[0]));
  };
  EXPECT_LT(gradient(true), 1e-9);
  EXPECT_GT(gradient(false), 1e-3);
}

TEST_F(CollapseTest, F1TenSeedsOfTheDefaultsTrain) {
  settings.epochs = 5;
  for (settings.seed = 0; settings.seed < 10; ++settings.seed) {
    const End end = train(settings);
    EXPECT_FALSE(end.collapsed || end.stopped) << "seed " << settings.seed;
    EXPECT_GT(end.active_latents, 0) << "seed " << settings.seed;
    EXPECT_GT(end.difference, 0.005) << "seed " << settings.seed;
  }
}

TEST_F(CollapseTest, F1ATooHighRateWithoutClippingAndWarmUpIsReported) {
  settings.epochs = 5;
  settings.clip_norm = settings.warm_up = 0;
  settings.learning_rate = 0.1;
  for (settings.seed = 0; settings.seed < 3; ++settings.seed) {
    const End end = train(settings);
    EXPECT_TRUE(end.collapsed || end.stopped) << "seed " << settings.seed;
  }
}

// The largest eigenvalue of the covariance of group 3's windows, by power iteration.
double largest_eigenvalue(const WindowSet& windows) {
  const auto entries = windows.frames() * 4;
  const auto n = static_cast<double>(windows.size());
  std::vector<double> rows, mean(entries), v(entries, 1);
  for (std::size_t i = 0; i < windows.size(); ++i) {
    for (std::size_t e = 0; e < entries; ++e) {
      rows.push_back(static_cast<double>(windows.raw_window(i)[e / 4 * rig::kTaxels + 12 + e % 4]));
      mean[e] += rows.back() / n;
    }
  }
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] -= mean[i % entries];
  double length = 0;
  for (int step = 0; step < 50; ++step) {
    std::vector<double> next(entries);
    for (auto row = rows.begin(); row != rows.end(); row += static_cast<std::ptrdiff_t>(entries)) {
      const double product = std::inner_product(v.begin(), v.end(), row, 0.0) / n;
      for (std::size_t e = 0; e < entries; ++e) next[e] += product * row[static_cast<std::ptrdiff_t>(e)];
    }
    length = std::sqrt(std::inner_product(next.begin(), next.end(), next.begin(), 0.0));
    for (std::size_t e = 0; e < entries; ++e) v[e] = next[e] / length;
  }
  return length;
}

// Mean squared error over D entries + beta KLD is the bound of a decoder of variance beta D / 2. Above the
// largest eigenvalue of the data no latent direction pays (Lucas et al. 2019, for linear decoders).
TEST_F(CollapseTest, F2PosteriorCollapsesAboveTheThresholdOfBetaAndIsReported) {
  settings.epochs = 8;
  settings.loss.a = 1;  // the VAEs alone: nothing else draws on the latents
  settings.learning_rate = 3e-3;
  const double threshold = 2 * largest_eigenvalue(windows) / (4.0 * static_cast<double>(windows.frames()));
  settings.loss.beta = threshold / 20;
  const End below = train(settings);
  EXPECT_FALSE(below.collapsed);
  EXPECT_GT(below.active_latents, 0);
  settings.loss.beta = threshold * 20;
  const End above = train(settings);
  EXPECT_TRUE(above.collapsed);
  EXPECT_EQ(above.active_latents, 0);
  EXPECT_GT(below.decoded, 20 * above.decoded);  // swapping z changes what is decoded, or does not
}

}  // namespace supertac::collapse_test
