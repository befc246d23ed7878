#include "data/scores/statistics.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>
#include <vector>

#include "io/numbers/numbers.h"
#include "io/numbers/random.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr std::size_t kDraws = 10'000;
constexpr std::uint64_t kRandomPatterns = 100'000;

}  // namespace

double share(std::span<const ClusterCount> clusters) {
  double correct = 0, total = 0;
  for (const ClusterCount& c : clusters) {
    correct += c.correct;
    total += c.total;
  }
  return total > 0 ? correct / total : std::numeric_limits<double>::quiet_NaN();
}

Interval bootstrap_interval(std::span<const ClusterCount> clusters, std::span<const std::size_t> strata) {
  const std::size_t count = clusters.size();
  if (count == 0) throw std::invalid_argument(refusal("bootstrap_interval", "clusters", "1 or more", "0"));
  if (!strata.empty()) expect_values("bootstrap_interval", "strata", count, strata.size());
  for (const ClusterCount& c : clusters)
    if (!(c.total > 0))
      throw std::invalid_argument(
          refusal("bootstrap_interval", "total of a cluster", "more than 0", format(c.total)));
  std::vector<std::size_t> order(count);  // clusters by stratum
  std::iota(order.begin(), order.end(), std::size_t{0});
  if (!strata.empty()) std::ranges::stable_sort(order, {}, [&](std::size_t c) { return strata[c]; });
  const RandomStream random(0, stream_named("boot"));
  std::uint64_t counter = 0;
  std::vector<double> shares(kDraws);
  for (double& one : shares) {
    double correct = 0, total = 0;
    for (std::size_t begin = 0, end = 0; begin < count; begin = end) {
      while (end < count && (strata.empty() || strata[order[end]] == strata[order[begin]])) ++end;
      for (std::size_t i = begin; i < end; ++i) {
        const double drawn = random.uniform(counter++) * static_cast<double>(end - begin);
        const ClusterCount& c = clusters[order[begin + static_cast<std::size_t>(drawn)]];
        correct += c.correct, total += c.total;
      }
    }
    one = correct / total;
  }
  std::sort(shares.begin(), shares.end());
  return {shares[kDraws / 40], shares[kDraws - 1 - kDraws / 40]};
}

double sign_flip_p(std::span<const double> differences) {
  if (differences.empty())
    throw std::invalid_argument(refusal("sign_flip_p", "differences", "1 or more", "0"));
  double observed = 0, size = 0;
  for (const double d : differences) {
    if (!std::isfinite(d))
      throw std::invalid_argument(refusal("sign_flip_p", "differences", "finite numbers", format(d)));
    observed += d;
    size += std::abs(d);
  }
  // Sums of the same numbers in another order differ by roundings; a tie must stay a tie.
  const double least = std::abs(observed) - 1e-9 * size;
  const bool exact = differences.size() < std::bit_width(kRandomPatterns);
  const std::uint64_t patterns = exact ? std::uint64_t{1} << differences.size() : kRandomPatterns;
  const RandomStream random(0, stream_named("sign"));
  std::uint64_t extreme = 0;
  for (std::uint64_t pattern = 0; pattern < patterns; ++pattern) {
    double sum = 0;
    for (std::size_t i = 0; i < differences.size(); ++i) {
      const bool flip =
          exact ? (pattern >> i) % 2 == 1 : random.bits(pattern * differences.size() + i) % 2 == 1;
      sum += flip ? -differences[i] : differences[i];
    }
    if (std::abs(sum) >= least) ++extreme;
  }
  const double extra = exact ? 0 : 1;
  return (static_cast<double>(extreme) + extra) / (static_cast<double>(patterns) + extra);
}

}  // namespace supertac
