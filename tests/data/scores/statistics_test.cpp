#include "data/scores/statistics.h"

#include "io/numbers/random.h"
#include "tests/support/test.h"

namespace supertac::statistics_test {

TEST(Share, CountsFramesNotPasses) {
  const ClusterCount counts[] = {{1, 10}, {90, 90}};
  EXPECT_DOUBLE_EQ(share(counts), 0.91);
  EXPECT_TRUE(std::isnan(share({})));
}

// One pass in two is right: the mean of n = 4 coins is 0 or 1 with p = 1/16 each, so 2.5 % lies there.
TEST(BootstrapInterval, IsThatOfTheBinomialForEqualPasses) {
  const ClusterCount four[] = {{0, 100}, {100, 100}, {0, 100}, {100, 100}};
  const Interval wide = bootstrap_interval(four);
  EXPECT_DOUBLE_EQ(wide.low, 0);
  EXPECT_DOUBLE_EQ(wide.high, 1);
  std::vector<ClusterCount> hundred;
  for (int i = 0; i < 100; ++i) hundred.push_back({i % 2 ? 10.0 : 0.0, 10});
  const Interval narrow = bootstrap_interval(hundred);
  EXPECT_NEAR(narrow.low, 0.5 - 1.96 * 0.05, 0.011);
  EXPECT_NEAR(narrow.high, 0.5 + 1.96 * 0.05, 0.011);
}

// The mistake this file exists against: 1000 frames of two passes are two observations.
TEST(BootstrapInterval, DoesNotShrinkWithFramesWithinAPass) {
  const ClusterCount few[] = {{9, 10}, {5, 10}, {7, 10}}, many[] = {{900, 1000}, {500, 1000}, {700, 1000}};
  EXPECT_DOUBLE_EQ(bootstrap_interval(few).low, bootstrap_interval(many).low);
  EXPECT_DOUBLE_EQ(bootstrap_interval(few).high, bootstrap_interval(many).high);
}

// Two plates, one easy and one hard, each with equal passes: nothing is left to chance within a plate.
TEST(BootstrapInterval, DrawsPassesWithinTheirPlate) {
  const std::vector<ClusterCount> passes = {{9, 10}, {5, 10}, {9, 10}, {5, 10}};
  const std::size_t plates[] = {0, 1, 0, 1};
  const Interval within = bootstrap_interval(passes, plates), all = bootstrap_interval(passes);
  EXPECT_DOUBLE_EQ(within.low, 0.7);
  EXPECT_DOUBLE_EQ(within.high, 0.7);
  EXPECT_LT(all.low, 0.6);
}

TEST(BootstrapInterval, RefusesNothing) {
  const ClusterCount empty[] = {{1, 2}, {0, 0}};
  const std::size_t stratum[] = {0};
  EXPECT_REFUSAL("bootstrap_interval: clusters expects 1 or more, got 0",
                 bootstrap_interval(std::span<const ClusterCount>()));
  EXPECT_REFUSAL("bootstrap_interval: strata expects 2 values, got 1", bootstrap_interval(empty, stratum));
  EXPECT_REFUSAL("bootstrap_interval: total of a cluster expects more than 0, got 0",
                 bootstrap_interval(empty));
}

// All eight patterns of 1, 2, 4: |sum| is 7 twice, 5 twice, 3 twice, 1 twice.
TEST(SignFlip, CountsPatternsByHand) {
  EXPECT_DOUBLE_EQ(sign_flip_p(std::vector<double>{1, 2, 4}), 2.0 / 8);
  EXPECT_DOUBLE_EQ(sign_flip_p(std::vector<double>{-1, 2, 4}), 4.0 / 8);
  EXPECT_DOUBLE_EQ(sign_flip_p(std::vector<double>{1, -2, -4}), 4.0 / 8);
  EXPECT_DOUBLE_EQ(sign_flip_p(std::vector<double>{1, 2, -4}), 1);
  EXPECT_DOUBLE_EQ(sign_flip_p(std::vector<double>{0, 0}), 1);
  EXPECT_DOUBLE_EQ(sign_flip_p(std::vector<double>{.1, .2, -.3}), 1) << "a tie but for rounding";
}

TEST(SignFlip, RandomPatternsAgreeWithAllOfThem) {
  std::vector<double> d;
  for (int i = 0; i < 20; ++i) d.push_back(std::sin(i) + 0.4);
  const double exact = sign_flip_p(d);
  d.push_back(0);  // changes no sum, but there are now too many to go through
  EXPECT_NEAR(sign_flip_p(d), exact, 0.005);
  EXPECT_GT(exact, 0.001);
  EXPECT_LT(exact, 0.2);
}

// Under the null hypothesis p is uniform: at most 5 % below 0.05.
TEST(SignFlip, RejectsATrueHypothesisAsOftenAsItSays) {
  const RandomStream random(3, 0);
  int rejected = 0;
  constexpr int kTrials = 400, kPasses = 10;
  for (int trial = 0; trial < kTrials; ++trial) {
    std::vector<double> d;
    for (int i = 0; i < kPasses; ++i)
      d.push_back(random.normal(static_cast<std::uint64_t>(trial * kPasses + i)));
    rejected += sign_flip_p(d) <= 0.05;
  }
  EXPECT_NEAR(rejected, 0.05 * kTrials, 14);  // three standard deviations
}

TEST(SignFlip, RefusesNothingAndWhatIsNoNumber) {
  EXPECT_REFUSAL("sign_flip_p: differences expects 1 or more, got 0", sign_flip_p({}));
  EXPECT_REFUSAL("sign_flip_p: differences expects finite numbers, got inf",
                 sign_flip_p(std::vector<double>{1, std::numeric_limits<double>::infinity()}));
}

}  // namespace supertac::statistics_test
