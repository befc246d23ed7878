#include "models/inference/novelty.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/expect_error.h"
#include "tests/models/support.h"

namespace supertac {
namespace {

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
  const Novelty novelty(plane(4000));
  const real centre[] = {0, 2, 2}, one[] = {1, 2, 3}, other[] = {0, 5, 5}, off[] = {0, 2, 3};
  EXPECT_NEAR(novelty.distance(centre), 0, 0.1);
  EXPECT_NEAR(novelty.distance(one), 1 / std::sqrt(3), 0.05);    // a standard deviation of the first
  EXPECT_NEAR(novelty.distance(other), 1 / std::sqrt(3), 0.05);  // of the second, three times as wide
  EXPECT_GT(novelty.distance(off), 10);                          // as far, but where nothing ever was
  EXPECT_TRUE(novelty.unlike_training(off));
  EXPECT_FALSE(novelty.unlike_training(other));
}

TEST(Novelty, OfTheTrainingItselfNothingIsUnlike) {
  const Tensor z = plane(1000);
  const Novelty novelty(z);
  for (Dim i = 0; i < 1000; ++i)
    EXPECT_FALSE(novelty.unlike_training(z.values().subspan(static_cast<std::size_t>(3 * i), 3)));
}

TEST(Novelty, FeaturesThatNeverVaryAreNoTrouble) {
  const Novelty novelty(Tensor::full({10, 2}, real(0.5)));
  const real same[] = {0.5, 0.5}, moved[] = {0.5, 0.6F};
  EXPECT_EQ(novelty.distance(same), 0);
  EXPECT_NEAR(novelty.distance(moved), 0.1 / std::sqrt(0.001) / std::sqrt(2), 0.01);  // least variance .001
}

TEST(Novelty, TravelsInTheModelFile) {
  const TemporaryFolder folder;
  const std::string path = folder / "m.safetensors";
  const Novelty novelty(plane(100));
  write_checkpoint(path, {}, {}, novelty.stored());
  const auto back = Novelty::read(read_checkpoint(path), path, 3);
  ASSERT_TRUE(back);
  const real z[] = {1, 0, 2};
  EXPECT_EQ(back->distance(z), novelty.distance(z));
  EXPECT_EQ(back->limit(), novelty.limit());
  EXPECT_EQ(what_of<std::runtime_error>([&] { Novelty::read(read_checkpoint(path), path, 4); }),
            path + ": the tensor novelty.mean does not fit a model of 4 features; train it again");
  write_checkpoint(path, {}, {});
  EXPECT_FALSE(Novelty::read(read_checkpoint(path), path, 3));
}

TEST(Novelty, RefusesTooFewFeatures) {
  EXPECT_EQ(what_of<std::invalid_argument>([&] { Novelty(plane(3)); }),
            "novelty: expects features [N,D] with N > D, got [3,3]");
  const real two[] = {0, 0};
  EXPECT_EQ(what_of<std::invalid_argument>([&] { Novelty(plane(10)).distance(two); }),
            "novelty: expects 3 features, got 2");
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

}  // namespace
}  // namespace supertac
