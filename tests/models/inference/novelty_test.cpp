#include "models/inference/novelty.h"

#include "tests/models/support.h"
#include "tests/support/test.h"

namespace supertac::novelty_test {

// Features of a plane: the third number is the sum of the other two.
Tensor plane(Dim n) {
  Tensor z(Shape{n, 3});
  const RandomStream random(1, 0);
  for (Dim i = 0; i < n; ++i) {
    real* row = z.data() + 3 * i;
    row[0] = static_cast<real>(random.normal(static_cast<std::uint64_t>(2 * i)));
    row[1] = static_cast<real>(2 + 3 * random.normal(static_cast<std::uint64_t>(2 * i + 1)));
    row[2] = row[0] + row[1];
  }
  return z;
}

TEST(Novelty, IsTheMahalanobisDistance) {
  const Tensor z = plane(4000);
  const Novelty novelty(z);
  for (Dim i = 0; i < 4000; ++i)  // of the training itself nothing is unlike
    ASSERT_FALSE(novelty.unlike_training(z.values().subspan(static_cast<std::size_t>(3 * i), 3)));
  const real centre[] = {0, 2, 2}, one[] = {1, 2, 3}, other[] = {0, 5, 5}, off[] = {0, 2, 3};
  EXPECT_NEAR(novelty.distance(centre), 0, 0.1);
  EXPECT_NEAR(novelty.distance(one), 1 / std::sqrt(3), 0.05);    // a standard deviation of the first
  EXPECT_NEAR(novelty.distance(other), 1 / std::sqrt(3), 0.05);  // of the second, three times as wide
  EXPECT_GT(novelty.distance(off), 10);                          // as far, but where nothing ever was
  EXPECT_TRUE(novelty.unlike_training(off));
  EXPECT_FALSE(novelty.unlike_training(other));
}

TEST(Novelty, FeaturesThatNeverVaryAreNoTrouble) {
  const Novelty novelty(Tensor::full({10, 2}, real(0.5)));
  const real same[] = {0.5, 0.5}, moved[] = {0.5, 0.6F};
  EXPECT_EQ(novelty.distance(same), 0);
  EXPECT_NEAR(novelty.distance(moved), 0.1 / std::sqrt(0.001) / std::sqrt(2), 0.01);  // least variance 0.001
}

TEST(Novelty, TravelsInTheModelFile) {
  const TemporaryFolder folder;
  const std::string path = folder / "m.safetensors";
  const Novelty novelty(plane(100));
  write_checkpoint(path, {}, {}, novelty.stored());
  const auto back = Novelty::read(SafetensorsFile::read(path), 3);
  ASSERT_TRUE(back);
  const real z[] = {1, 0, 2};
  EXPECT_EQ(back->distance(z), novelty.distance(z));
  EXPECT_EQ(back->limit(), novelty.limit());
  EXPECT_EQ(what_of<std::runtime_error>([&] { Novelty::read(SafetensorsFile::read(path), 4); }),
            path + ": the tensor novelty.mean does not fit a model of 4 features; train it again");
  write_checkpoint(path, {}, {});
  EXPECT_FALSE(Novelty::read(SafetensorsFile::read(path), 3));
}

TEST(Novelty, RefusesTooFewFeatures) {
  EXPECT_REFUSAL("novelty: features expects [N,D] with N > D, got [3,3]", Novelty(plane(3)));
  const real two[] = {0, 0};
  EXPECT_REFUSAL("novelty: features expects [3], got [2]", Novelty(plane(10)).distance(two));
}

// A trained model knows its own windows again, and not those of a sensor with a stuck taxel.
TEST(Novelty, ComesWithATrainedModel) {
  const TemporaryFolder folder;
  const SmallTraining small;
  const WindowSet& windows = small.windows;
  Trainer trainer = small.trainer();
  while (!trainer.done()) trainer.train_step();
  save_trained(trainer, folder / "m.safetensors", {});
  const ModelFile file = load_model(folder / "m.safetensors");
  EXPECT_TRUE(file.ranges) << "of its values, for int8";
  ASSERT_TRUE(file.novelty);
  std::vector<float> window(32 * 16);
  windows.window(windows.size() / 2, window);
  EXPECT_FALSE(file.novelty->unlike_training(signal_features(window, windows.array())));
  for (std::size_t t = 0; t < 32; ++t) window[16 * t + 5] = 0.9F;
  EXPECT_TRUE(file.novelty->unlike_training(signal_features(window, windows.array())));
}

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

TEST(SignalFeatures, FollowTheArrayAndAreFiniteOfSilence) {
  const TaxelArray array{.rows = 3, .columns = 5, .channels = 2};
  const std::vector<float> features = signal_features(std::vector<float>(kLength * array.signals()), array);
  EXPECT_EQ(features.size(), 2U * 30 + 2);
  for (const float f : features) EXPECT_TRUE(std::isfinite(f));
}

TEST(SignalFeatures, RefuseAPieceOfAFrame) {
  for (const std::size_t values : {16 * 16 - 1, 15 * 16}) {
    const std::string text = std::to_string(values);
    EXPECT_REFUSAL(
        "signal features: window expects 1 frame or 16 or more of 16 signals, and out room for 35, got " +
            text + " signals and room for 35",
        signal_features(std::vector<float>(values), TaxelArray{}));
  }
}

}  // namespace supertac::novelty_test
