// A warm training step and a warm inference, compiled or not, go to the heap not once.
#include <gtest/gtest.h>

#include <functional>

#include "tests/allocations.h"
#include "tests/models/support.h"

namespace supertac {
namespace {

long allocations_of_five(const std::function<void()>& warm) {
  for (int i = 0; i < 3; ++i) warm();
  const long before = allocations::made;
  for (int i = 0; i < 5; ++i) warm();
  return allocations::made - before;
}

TEST(NoAllocation, WarmTrainingStep) {
  SmallTraining small;
  small.recipe.augment = kStandardAugmentation;
  Trainer trainer = small.trainer();
  EXPECT_EQ(allocations_of_five([&] { trainer.train_step(); }), 0);
}

TEST(NoAllocation, WarmInference) {
  const SuperTac network = random_network(SuperTacSettings::of_preset("paper"));
  const CompiledModel compiled(network);
  const Tensor one = uniform(network.input_shape(1), 1), many = uniform(network.input_shape(9), 1);
  EXPECT_EQ(allocations_of_five([&] { network.infer(one); }), 0);
  EXPECT_EQ(allocations_of_five([&] { compiled.estimate(one), compiled.estimate(many); }), 0);
}

}  // namespace
}  // namespace supertac
