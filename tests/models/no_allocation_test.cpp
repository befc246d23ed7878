// A warm training step and a warm inference go to the heap not once.
#include <gtest/gtest.h>
#include <omp.h>

#include <atomic>
#include <cstdlib>
#include <new>

#include "models/evaluation.h"
#include "tests/models/support.h"

namespace {
std::atomic<long> allocations{0};

void* counted(std::size_t bytes, std::size_t alignment) {
  allocations.fetch_add(1, std::memory_order_relaxed);
  void* block = nullptr;
  if (posix_memalign(&block, std::max(alignment, sizeof(void*)), bytes) != 0) throw std::bad_alloc();
  return block;
}
}  // namespace

void* operator new(std::size_t bytes) { return counted(bytes, 16); }
void* operator new[](std::size_t bytes) { return counted(bytes, 16); }
void* operator new(std::size_t bytes, std::align_val_t a) {
  return counted(bytes, static_cast<std::size_t>(a));
}
void* operator new[](std::size_t bytes, std::align_val_t a) {
  return counted(bytes, static_cast<std::size_t>(a));
}
void* operator new(std::size_t bytes, const std::nothrow_t&) noexcept { return counted(bytes, 16); }
void operator delete(void* p) noexcept { std::free(p); }
void operator delete[](void* p) noexcept { std::free(p); }
void operator delete(void* p, std::size_t) noexcept { std::free(p); }
void operator delete[](void* p, std::size_t) noexcept { std::free(p); }
void operator delete(void* p, std::align_val_t) noexcept { std::free(p); }
void operator delete[](void* p, std::align_val_t) noexcept { std::free(p); }
void operator delete(void* p, std::size_t, std::align_val_t) noexcept { std::free(p); }
void operator delete[](void* p, std::size_t, std::align_val_t) noexcept { std::free(p); }

namespace supertac {
namespace {

TEST(NoAllocation, WarmTrainingStep) {
  TrainingSettings settings = small_training();
  settings.epochs = 4;
  settings.augment = {.gain = 0.5, .taxel_gain = 0.3, .offset = 0.05, .noise = 0.02, .dropped = 2};
  const WindowSet windows = small_windows(settings.model);
  Trainer trainer(windows, all_of(windows), settings);
  for (int i = 0; i < 3; ++i) trainer.train_step();
  const long before = allocations;
  for (int i = 0; i < 5; ++i) trainer.train_step();
  EXPECT_EQ(allocations - before, 0);
}

TEST(NoAllocation, WarmInference) {
  Rng rng(1);
  const SuperTac model(SuperTacSettings::of_preset("paper"), rng);
  const Tensor window = uniform({1, 256, 16}, 1);
  for (int i = 0; i < 3; ++i) model.infer(window);
  const long before = allocations;
  for (int i = 0; i < 5; ++i) model.infer(window);
  EXPECT_EQ(allocations - before, 0);
}

}  // namespace
}  // namespace supertac
