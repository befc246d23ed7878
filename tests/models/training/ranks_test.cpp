#include "models/training/ranks.h"

#include <omp.h>

#include <atomic>
#include <barrier>
#include <thread>

#include "tests/models/support.h"
#include "tests/support/test.h"

namespace supertac::training_ranks_test {

using Texts = std::vector<std::string>;

/// Where two ranks meet, and what each says there.
struct Meeting {
  std::barrier<> both{2};
  std::span<const std::byte> said[2];
};
using Meetings = std::map<std::pair<int, int>, Meeting>;  // by the lower rank and the higher one

/// Ranks that are threads of the test.
class ThreadRanks : public Ranks {
 public:
  ThreadRanks(int rank, int size, Meetings& meetings) : Ranks(rank, size), meetings_(meetings) {}
  ~ThreadRanks() override {  // nobody waits for one that has gone
    for (auto& [who, meeting] : meetings_) {
      if (who.first != rank() && who.second != rank()) continue;
      meeting.said[who.second == rank()] = {};
      meeting.both.arrive_and_drop();
    }
  }
  void exchange(int partner, std::span<const std::byte> mine, std::span<std::byte> theirs) override {
    Meeting& meeting = meetings_.at(std::minmax(rank(), partner));
    meeting.said[rank() > partner] = mine;
    meeting.both.arrive_and_wait();
    const std::span<const std::byte> its = meeting.said[rank() < partner];
    if (its.size() != theirs.size()) throw RanksError("another size than expected");
    std::ranges::copy(its, theirs.begin());
    meeting.both.arrive_and_wait();
  }

 private:
  Meetings& meetings_;
};

/// Runs `work` on every rank at once; returns what each threw ("" = nothing).
Texts on_ranks(int size, const std::function<void(Ranks&)>& work) {
  Meetings meetings;
  for (int high = 1; high < size; ++high)
    for (int low = 0; low < high; ++low) meetings[{low, high}];
  Texts errors(static_cast<std::size_t>(size));
  std::vector<std::jthread> threads;
  for (int rank = 0; rank < size; ++rank) {
    threads.emplace_back([&, rank] {
      ThreadRanks ranks(rank, size, meetings);
      try {
        work(ranks);
      } catch (const std::exception& error) {
        errors[static_cast<std::size_t>(rank)] = error.what();
      }
    });
  }
  threads.clear();
  return errors;
}

TEST(Ranks, OnlyNumbersThatShareTheMicroBatchesAreTaken) {
  for (const int ranks : {1, 2, 4, 8}) EXPECT_NO_THROW(check_micro_batches(ranks, 8));
  EXPECT_NO_THROW(check_micro_batches(1, 3));
  EXPECT_NO_THROW(check_micro_batches(16, 128));
  for (const int ranks : {3, 5, 6, 7, 9, 16})
    EXPECT_REFUSAL(std::to_string(ranks) +
                       " processes cannot share the 8 micro-batches of a batch of 64 evenly; start 1, 2, 4 "
                       "or 8 processes",
                   check_micro_batches(ranks, 64));
  EXPECT_REFUSAL(
      "32 processes cannot share the 16 micro-batches of a batch of 128 evenly; start 1, 2, 4, 8 or 16 "
      "processes",
      check_micro_batches(32, 128));
  EXPECT_ERROR(check_micro_batches(2, 7), std::invalid_argument,
               "several processes need a batch of at least 8, got 7");
}

TEST(MicroBatches, HaveEightSamplesWhereThereAreSixteenOfThem) {
  const std::pair<std::size_t, std::size_t> expected[] = {{1, 1},   {7, 7},    {8, 8},
                                                          {127, 8}, {128, 16}, {4096, 16}};
  for (const auto& [batch, micro_batches] : expected)
    EXPECT_EQ(micro_batches_of(batch), micro_batches) << batch;
}

TEST(Ranks, ARankThatDiffersFromTheFirstIsNamed) {
  on_ranks(4, [](Ranks& ranks) {
    EXPECT_FALSE(find_disagreement(ranks, {{"build", "a"}, {"data", "b"}}));
    const auto odd = find_disagreement(ranks, {{"build", "a"}, {"data", ranks.rank() == 3 ? "c" : "b"}});
    ASSERT_TRUE(odd);
    EXPECT_EQ(odd->rank, 3);
    EXPECT_EQ(odd->entry + odd->its + odd->of_first, "datacb");
    std::map<std::string, std::string> entries{{"build", "a"}};
    if (ranks.rank() == 2) entries["data"] = "b";
    const auto more = find_disagreement(ranks, entries);
    ASSERT_TRUE(more);
    EXPECT_EQ(more->rank, 2);
    EXPECT_EQ(more->of_first, "missing");
  });
}

class RanksTrain : public testing::Test {
 protected:
  RanksTrain() {
    small_.recipe.augment = {.gain = 0.5, .noise = 0.02};
    small_.recipe.batch = 12;  // micro-batches of one and of two samples
  }
  Trainer trainer(Ranks& ranks) const {
    return {small_.windows, all_of(small_.windows), small_.recipe, ranks};
  }
  /// From the state in `from` ("" = start) by `ranks` for `steps` steps; the state's file.
  std::string train(int size, const std::string& from, std::int64_t steps) {
    const std::string to = folder_ / ("state" + std::to_string(++files_) + ".safetensors");
    const Texts errors = on_ranks(size, [&](Ranks& ranks) {
      omp_set_num_threads(1);
      Trainer t = trainer(ranks);
      if (!from.empty()) t.restore(from, {});
      for (std::int64_t i = 0; i < steps && !t.done(); ++i) last_loss_ = t.train_step().total;
      t.save(to, {});
    });
    EXPECT_EQ(errors, Texts(static_cast<std::size_t>(size)));
    return to;
  }

  TemporaryFolder folder_;
  SmallTraining small_;
  std::atomic<double> last_loss_ = 0;

 private:
  int files_ = 0;
};

TEST_F(RanksTrain, TheSameBytesForAnyNumberOfThem) {
  const std::string alone = file_text(train(1, "", 1000));
  const double loss = last_loss_;
  for (const int size : {2, 4, 8}) {
    EXPECT_TRUE(alone == file_text(train(size, "", 1000))) << size;
    EXPECT_EQ(last_loss_, loss);
  }
  std::string state;
  for (const int size : {4, 2, 1, 8}) state = train(size, state, 4);
  EXPECT_TRUE(alone == file_text(train(2, state, 1000))) << "stopped and resumed with other numbers";
}

TEST_F(RanksTrain, SixteenShareABatchOf128) {
  small_.recipe.batch = 128;
  const std::string alone = file_text(train(1, "", 2));
  EXPECT_TRUE(alone == file_text(train(16, "", 2)));
  EXPECT_TRUE(alone == file_text(train(2, "", 2)));
}

TEST_F(RanksTrain, StopTogetherWhenOneWishesTo) {
  on_ranks(4, [&](Ranks& ranks) {
    Trainer t = trainer(ranks);
    std::int64_t steps = 0;
    while (!t.train_step([&] { return ranks.rank() == 2 && t.step() == 5; }).stop) ++steps;
    EXPECT_EQ(steps, 5);
  });
}

TEST_F(RanksTrain, ADifferenceNamesRankAndTensorAndKeepsTheState) {
  const std::string path = train(2, "", 3), before = file_text(path);
  const Texts errors = on_ranks(4, [&](Ranks& ranks) {
    Trainer t = trainer(ranks);
    t.restore(path, {});
    if (ranks.rank() == 3) parameter_of(t.model(), "upsampler.out.weight").mutable_value().data()[5] += 1e-6F;
    t.train_step();
    t.save(path, {});
  });
  for (const std::string& error : errors)
    EXPECT_TRUE(error.starts_with("after step 4 rank 3 holds another upsampler.out.weight than rank 0"))
        << error;
  EXPECT_TRUE(before == file_text(path));
}

TEST_F(RanksTrain, AllNameTheLayerThatIsNotFinite) {
  const Texts errors = on_ranks(2, [&](Ranks& ranks) {
    Trainer t = trainer(ranks);
    if (ranks.rank() == 1) parameter_of(t.model(), "upsampler.out.weight").mutable_value().fill(NAN);
    t.train_step();
  });
  for (const std::string& error : errors)
    EXPECT_NE(error.find("parameter upsampler.out.weight is not finite"), std::string::npos) << error;
}

}  // namespace supertac::training_ranks_test
