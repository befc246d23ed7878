#include "data/windows/batching.h"

#include "tests/support/test.h"

namespace supertac::batching_test {

TEST(EpochOrder, IsAPermutationOfAnyCount) {
  for (const std::uint64_t count : {1U, 2U, 3U, 4U, 5U, 16U, 17U, 1000U, 4097U}) {
    const EpochOrder order(count, 5, 0);
    std::vector<bool> seen(count, false);
    for (std::uint64_t i = 0; i < count; ++i) {
      const std::uint64_t v = order[i];
      ASSERT_LT(v, count);
      ASSERT_FALSE(seen[v]);
      seen[v] = true;
    }
  }
}

TEST(EpochOrder, ChangesWithSeedAndEpoch) {
  const EpochOrder a(1000, 5, 0), b(1000, 5, 1), c(1000, 6, 0), again(1000, 5, 0);
  int same_b = 0, same_c = 0;
  for (std::uint64_t i = 0; i < 1000; ++i) {
    same_b += a[i] == b[i] ? 1 : 0;
    same_c += a[i] == c[i] ? 1 : 0;
    ASSERT_EQ(a[i], again[i]);
  }
  EXPECT_LT(same_b, 10);  // one is expected by chance
  EXPECT_LT(same_c, 10);
}

// Every element lands in every tenth of the order equally often, and neighbours do not stay together.
TEST(EpochOrder, Mixes) {
  constexpr std::uint64_t kCount = 1000, kEpochs = 200;
  int in_first_tenth = 0;
  double neighbours = 0;
  for (std::uint64_t epoch = 0; epoch < kEpochs; ++epoch) {
    const EpochOrder order(kCount, 9, epoch);
    for (std::uint64_t i = 0; i < kCount; ++i) {
      const double here = static_cast<double>(order[i]), next = static_cast<double>(order[(i + 1) % kCount]);
      neighbours += here > next ? here - next : next - here;
      if (i < kCount / 10 && order[i] < kCount / 10) ++in_first_tenth;
    }
  }
  EXPECT_NEAR(in_first_tenth, 10.0 * kEpochs, 150);
  EXPECT_NEAR(neighbours / (kCount * kEpochs), kCount / 3.0, 5);
}

TEST(EpochOrder, RefusesNothing) {
  EXPECT_REFUSAL("epoch order: count expects 1 to 2^32, got 0", EpochOrder(0, 1, 1));
  EXPECT_REFUSAL("epoch order: index expects a number below 5, got 5", EpochOrder(5, 1, 1)[5]);
}

std::vector<std::uint32_t> hundred() {
  std::vector<std::uint32_t> indices(100);
  std::iota(indices.begin(), indices.end(), 1000U);
  return indices;
}

TEST(Batching, AnEpochShowsEachWindowAtMostOnceAndFillsEveryBatch) {
  const Batching batching(hundred(), 16, 3);
  EXPECT_EQ(batching.batches_per_epoch(), 6U);
  std::set<std::uint32_t> seen;
  std::vector<std::uint32_t> batch(16);
  for (std::uint64_t step = 12; step < 18; ++step) {
    batching.batch(step, batch);
    seen.insert(batch.begin(), batch.end());
  }
  EXPECT_EQ(seen.size(), 96U);
  EXPECT_GE(*seen.begin(), 1000U);
  EXPECT_LT(*seen.rbegin(), 1100U);
}

TEST(Batching, ABatchDependsOnNothingButItsStep) {
  const Batching one(hundred(), 16, 3), other(hundred(), 16, 3);
  std::vector<std::uint32_t> a(16), b(16), c(16);
  one.batch(0, a);  // history must not matter
  one.batch(7 * 6 + 4, a);
  other.batch(7 * 6 + 4, b);
  other.batch(8 * 6 + 4, c);
  EXPECT_EQ(a, b);
  EXPECT_NE(a, c);
}

TEST(Batching, SamplesAreCountedThroughTheEpochs) {
  const Batching batching(hundred(), 16, 3);
  EXPECT_EQ(batching.sample(0, 5), 5U);
  EXPECT_EQ(batching.sample(8, 3), 8U * 16U + 3U);
}

TEST(Batching, FewerWindowsThanABatchMakeOneBatch) {
  const Batching batching(hundred(), 256, 3);
  EXPECT_EQ(batching.batches_per_epoch(), 1U);
  std::vector<std::uint32_t> batch(batching.batch_size());
  batching.batch(0, batch);
  std::sort(batch.begin(), batch.end());
  EXPECT_EQ(batch, hundred());
}

TEST(Batching, RefusesWhatIsNotThere) {
  EXPECT_REFUSAL("batching: windows expects one to train on, or more, got none", Batching({}, 16, 3));
  EXPECT_REFUSAL("batching: batch expects 1 or more, got 0", Batching(hundred(), 0, 3));
  const Batching batching(hundred(), 16, 3);
  std::vector<std::uint32_t> small(15);
  EXPECT_REFUSAL("batching: out expects 16 windows, got 15", batching.batch(0, small));
}

}  // namespace supertac::batching_test
