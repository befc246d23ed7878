#include "autograd/kernels/fast/pool.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <thread>

#include "tests/autograd/check.h"

namespace supertac {
namespace {

TEST(Pool, AReleasedBlockIsHandedOutAgain) {
  void* first = pool_allocate(1000);
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(first) % 64, 0U);
  pool_release(first, 1000);
  void* again = pool_allocate(1001);  // the same size class
  EXPECT_EQ(again, first);
  pool_release(again, 1001);
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
