#include "autograd/kernels/fast/pool.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <thread>
#include <vector>

#include "autograd/ops/activations.h"
#include "autograd/ops/convolution.h"
#include "autograd/ops/losses.h"
#include "autograd/optimisers/adam.h"
#include "tests/autograd/check.h"

namespace supertac {
namespace {

TEST(Pool, AReleasedBlockIsHandedOutAgain) {
  void* first = pool_allocate(1000);
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(first) % 64, 0U);
  pool_release(first, 1000);
  const std::uint64_t before = pool_heap_allocations();
  void* again = pool_allocate(1001);  // the same size class
  EXPECT_EQ(again, first);
  EXPECT_EQ(pool_heap_allocations(), before);
  pool_release(again, 1001);
}

TEST(Pool, CountsWhatItTakesFromTheHeap) {
  constexpr std::size_t kBytes = 3'333'333;  // of a size that no other test asks for
  const std::uint64_t before = pool_heap_allocations();
  void* block = pool_allocate(kBytes);
  EXPECT_EQ(pool_heap_allocations(), before + 1);
  pool_release(block, kBytes);
}

TEST(Pool, BlocksOfAnEndedThreadServeTheNextOne) {
  constexpr std::size_t kBytes = 777'777;  // of a size that no other test asks for
  void* block = nullptr;
  const auto borrow = [&] {
    block = pool_allocate(kBytes);
    pool_release(block, kBytes);
  };
  std::thread(borrow).join();
  const void* const first = block;
  std::thread(borrow).join();
  EXPECT_EQ(block, first);
}

// A block must hold what was asked for at every size class boundary; the sanitizer build sees an overrun.
TEST(Pool, EveryByteOfABlockIsUsable) {
  for (std::size_t bytes = 1; bytes < 5000; bytes += bytes < 300 ? 1 : 37) {
    auto* block = static_cast<unsigned char*>(pool_allocate(bytes));
    block[0] = block[bytes - 1] = 1;
    pool_release(block, bytes);
  }
}

TEST(Pool, BlocksInUseDoNotOverlap) {
  std::vector<Tensor> held;
  for (int i = 0; i < 200; ++i) held.push_back(Tensor::full({1 + i % 13}, static_cast<real>(i)));
  for (int i = 0; i < 200; ++i) {
    for (const real x : held[static_cast<std::size_t>(i)].values()) ASSERT_EQ(x, static_cast<real>(i));
  }
}

TEST(Pool, AnotherThreadMayReleaseWhatThisOneAllocated) {
  for (int i = 0; i < 50; ++i) {
    Tensor t = Tensor::full({1000}, 1);
    std::thread([moved = std::move(t)]() mutable { moved = Tensor(); }).join();
  }
  Tensor made_elsewhere;
  std::thread([&] { made_elsewhere = Tensor::full({3}, 5); }).join();
  test::expect_values(made_elsewhere, {3}, {5, 5, 5});  // outlives the pool of the thread that made it
}

}  // namespace
}  // namespace supertac
