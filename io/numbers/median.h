// The median and other quantiles.
#pragma once

#include <algorithm>
#include <cstddef>

namespace supertac {

/// The value that the share `q` of the values lies below: the one at place q n (rounded down, at most n - 1)
/// of n sorted ones. Reorders them; there must be at least one.
template <class Range>
auto quantile(Range&& values, double q) {
  const auto place =
      std::min(static_cast<std::size_t>(q * static_cast<double>(values.size())), values.size() - 1);
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(place);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// The middle one, the upper of two; reorders the values. There must be at least one.
template <class Range>
auto median(Range&& values) {
  return quantile(values, 0.5);
}

/// The standard deviation of normal numbers, from their distances from their median; reorders these.
template <class Range>
double normal_deviation(Range&& distances) {
  return 1.4826 * median(distances);
}

}  // namespace supertac
