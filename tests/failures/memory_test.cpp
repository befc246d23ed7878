// Out of memory: the N-th `new` fails, for every N, while a model is loaded, trained for a step, and run.
// Each failure must arrive as std::bad_alloc, leave nothing behind, and a second try must succeed.
#include <omp.h>

#include <new>

#include "tests/allocations.h"
#include "tests/models/support.h"
#include "tests/support/test.h"

namespace supertac::memory_test {

// Runs `work` with its first, second, ... allocation failing until it comes through; returns how many failed.
template <class F>
long fail_every_allocation(F work) {
  for (long n = 0;; ++n) {
    bool caught = false;
    allocations::failed = false;
    allocations::until_fails = n;
    try {
      work();
    } catch (const std::bad_alloc&) {
      caught = true;
    }
    allocations::until_fails = -1;
    if (!allocations::failed) return n;
    EXPECT_TRUE(caught) << "allocation " << n << " failed and nobody said so";
    if (!caught) return n;
  }
}

// The same twice: pools keep what the first round has brought them, and the second must leave nothing more.
template <class F>
void expect_survival(F work) {
  EXPECT_GT(fail_every_allocation(work), 0);
  work();
  const long before = allocations::live;
  fail_every_allocation(work);
  EXPECT_EQ(allocations::live - before, 0) << "blocks were lost";
}

class MemoryTest : public ::testing::Test {
 protected:
  MemoryTest() { omp_set_num_threads(1); }
  ~MemoryTest() override { omp_set_num_threads(before_); }
  int before_ = omp_get_max_threads();
};

// Not reading the file: the JSON library that reads its header and settings allocates in a destructor, and
// when that very allocation fails the program ends (README.md).
TEST_F(MemoryTest, LoadingParameters) {
  const TemporaryFolder folder;
  const std::string path = folder / "m.safetensors";
  const SuperTac model = random_network();
  save_model(path, model, {}, {});
  const SafetensorsFile file = SafetensorsFile::read(path);
  expect_survival([&] { load_parameters(file, model.parameters()); });
}

TEST_F(MemoryTest, OneTrainingStep) {
  SmallTraining small;
  small.recipe.batch = 1;  // one micro-batch
  small.windows = small_windows(small.recipe.model, 60);
  expect_survival([&] { small.trainer().train_step(); });
}

TEST_F(MemoryTest, InferenceOfNewWindows) {
  SuperTacSettings larger = small_settings();  // than what the pool has kept of the other tests
  larger.timesteps = 128;
  const SuperTac model = random_network(larger);
  expect_survival([&] { model.infer(uniform({16, 128, 16}, 1)); });
}

}  // namespace supertac::memory_test
