// Is a difference between two methods more than chance? Frames of one pass resemble each other, so the
// independent unit of every figure here is the pass (the cluster), never the frame.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace supertac {

/// Successes of one method among the frames of one pass; a mean over seeds need not be whole.
struct ClusterCount {
  double correct = 0, total = 0;
};

struct Interval {
  double low = 0, high = 0;
};

/// Sum of correct / sum of total; NaN when there is nothing to count.
double share(std::span<const ClusterCount> clusters);

/// 95 % percentile bootstrap interval of share() over clusters drawn with replacement (Efron & Tibshirani
/// 1993, ch. 13; 10,000 draws: the same counts, the same interval), within each stratum (strata[c], a plate
/// say; none: all are one) as many as there are. Throws std::invalid_argument when there is no cluster or one
/// holds nothing, or strata are of another number.
Interval bootstrap_interval(std::span<const ClusterCount> clusters, std::span<const std::size_t> strata = {});

/// Two-sided p-value of the paired permutation test: if two methods did not differ, exchanging their results
/// within a pass, which flips the sign of that pass's difference, would change nothing. p is the share of the
/// sign patterns whose |sum| is at least the observed one: of all 2^n for n <= 16, else of 100,000 random
/// ones and the observed one. The smallest p for n passes is 2 / 2^n.
/// Throws std::invalid_argument when there is no difference or one is not finite.
double sign_flip_p(std::span<const double> differences);

}  // namespace supertac
