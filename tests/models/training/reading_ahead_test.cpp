// What a training announces before it reads it, so that a disk may fetch it meanwhile.
#include <gtest/gtest.h>

#include <set>
#include <utility>

#include "models/training/objective.h"
#include "models/training/trainer.h"
#include "tests/models/support.h"

namespace supertac {
namespace {

// Windows that note which of them is announced, and which is read.
struct Watched : WindowSet {
  explicit Watched(const WindowSet& windows) : WindowSet(windows) {}
  using WindowSet::window;
  void window(std::size_t i, std::span<float> out) const override {
#pragma omp critical
    read.insert(i);
    WindowSet::window(i, out);
  }
  void will_read(std::size_t i) const override { announced.insert(i); }
  mutable std::multiset<std::size_t> announced, read;
};

// Over the end of an epoch too; behind the last step nothing is read.
TEST(ReadingAhead, AnnouncesTheWindowsOfTheNextStep) {
  const SmallTraining small;
  const Watched watched(small.windows);
  Trainer trainer(watched, all_of(watched), Objective(watched, small.recipe));
  std::multiset<std::size_t> before;
  for (; !trainer.done(); before = std::exchange(watched.announced, {})) {
    watched.read.clear();
    const bool first = trainer.step() == 0;
    trainer.train_step();
    EXPECT_TRUE(first || watched.read == before) << "step " << trainer.step();
  }
  EXPECT_TRUE(before.empty());
  EXPECT_GT(trainer.step(), trainer.steps_per_epoch());
}

}  // namespace
}  // namespace supertac
