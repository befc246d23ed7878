// A warm training step and a warm inference go to the heap not once.
#include <gtest/gtest.h>
#include <omp.h>

#include "models/inference/evaluation.h"
#include "tests/allocations.h"
#include "tests/models/support.h"

namespace supertac {
namespace {

TEST(NoAllocation, WarmTrainingStep) {
  Recipe settings = small_training();
  settings.epochs = 4;
  settings.augment = kStandardAugmentation;
  const WindowSet windows = small_windows(settings.model);
  Trainer trainer(windows, all_of(windows), Objective(windows, settings));
  for (int i = 0; i < 3; ++i) trainer.train_step();
  const long before = allocations::made;
  for (int i = 0; i < 5; ++i) trainer.train_step();
  EXPECT_EQ(allocations::made - before, 0);
}

TEST(NoAllocation, WarmInference) {
  Rng rng(1);
  const SuperTac model(SuperTacSettings::of_preset("paper"), rng);
  const Tensor window = uniform({1, 256, 16}, 1);
  for (int i = 0; i < 3; ++i) model.infer(window);
  const long before = allocations::made;
  for (int i = 0; i < 5; ++i) model.infer(window);
  EXPECT_EQ(allocations::made - before, 0);
}

}  // namespace
}  // namespace supertac
