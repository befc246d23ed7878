// Out of memory: the N-th `new` fails, for every N, while a model is loaded, trained for a step, and run.
// Each failure must arrive as std::bad_alloc, leave nothing behind, and a second try must succeed.
#include <gtest/gtest.h>
#include <omp.h>

#include <atomic>
#include <cstdlib>
#include <new>

#include "tests/models/support.h"

namespace {

std::atomic<long> live{0};    // blocks not given back
std::atomic<long> until{-1};  // allocations until one fails; negative: never
std::atomic<bool> failed{false};

void* allocate(std::size_t bytes, std::size_t alignment) {
  if (until.load() >= 0 && until.fetch_sub(1) == 0) {
    failed = true;
    throw std::bad_alloc();
  }
  void* block = nullptr;
  if (posix_memalign(&block, std::max(alignment, sizeof(void*)), bytes) != 0) throw std::bad_alloc();
  ++live;
  return block;
}

void give_back(void* block) noexcept {
  if (block == nullptr) return;
  --live;
  std::free(block);
}

}  // namespace

void* operator new(std::size_t bytes) { return allocate(bytes, 16); }
void* operator new[](std::size_t bytes) { return allocate(bytes, 16); }
void* operator new(std::size_t bytes, std::align_val_t a) {
  return allocate(bytes, static_cast<std::size_t>(a));
}
void* operator new[](std::size_t bytes, std::align_val_t a) {
  return allocate(bytes, static_cast<std::size_t>(a));
}
void operator delete(void* p) noexcept { give_back(p); }
void operator delete[](void* p) noexcept { give_back(p); }
void operator delete(void* p, std::size_t) noexcept { give_back(p); }
void operator delete[](void* p, std::size_t) noexcept { give_back(p); }
void operator delete(void* p, std::align_val_t) noexcept { give_back(p); }
void operator delete[](void* p, std::align_val_t) noexcept { give_back(p); }
void operator delete(void* p, std::size_t, std::align_val_t) noexcept { give_back(p); }
void operator delete[](void* p, std::size_t, std::align_val_t) noexcept { give_back(p); }

namespace supertac {
namespace {

// Runs `work` with its first, second, ... allocation failing until it comes through; returns how many failed.
template <class F>
long fail_every_allocation(F work) {
  for (long n = 0;; ++n) {
    bool caught = false;
    failed = false;
    until = n;
    try {
      work();
    } catch (const std::bad_alloc&) {
      caught = true;
    }
    until = -1;
    if (!failed) return n;
    EXPECT_TRUE(caught) << "allocation " << n << " failed and nobody said so";
    if (!caught) return n;
  }
}

// The same twice: pools keep what the first round has brought them, and the second must leave nothing more.
template <class F>
void expect_survival(F work) {
  EXPECT_GT(fail_every_allocation(work), 0);
  work();
  const long before = live;
  fail_every_allocation(work);
  EXPECT_EQ(live - before, 0) << "blocks were lost";
}

class MemoryTest : public ::testing::Test {
 protected:
  MemoryTest() { omp_set_num_threads(1); }
  ~MemoryTest() override { omp_set_num_threads(before_); }
  TrainingSettings settings_ = small_training();
  int before_ = omp_get_max_threads();
};

// Not load_model() as a whole: the JSON library that reads its settings allocates in a destructor, and when
// that very allocation fails the program ends (README.md).
TEST_F(MemoryTest, LoadingParameters) {
  const TemporaryFolder folder;
  const std::string path = folder / "m.safetensors";
  Rng rng(1);
  const SuperTac model(small_settings(), rng);
  save_model(path, model, {}, {});
  expect_survival([&] { load_parameters(read_checkpoint(path), path, model.parameters()); });
}

TEST_F(MemoryTest, OneTrainingStep) {
  const WindowSet windows = small_windows(settings_.model, 60);
  settings_.batch = 1;  // one lane
  const auto step = [&] {
    Trainer trainer(windows, all_of(windows), settings_);
    trainer.train_step();
  };
  expect_survival(step);
}

TEST_F(MemoryTest, InferenceOfNewWindows) {
  SuperTacSettings larger = small_settings();  // than what the pool has kept of the other tests
  larger.timesteps = 128;
  Rng rng(1);
  const SuperTac model(larger, rng);
  expect_survival([&] { model.infer(uniform({16, 128, 16}, 1)); });
}

}  // namespace
}  // namespace supertac
