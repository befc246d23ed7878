#pragma once

#include <algorithm>
#include <vector>

namespace supertac::bench {

/// The share `q` of the values lies below: 0.5 is the median. `values` must not be empty.
inline double quantile(std::vector<double> values, double q) {
  const auto at = static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

inline double median(std::vector<double> values) { return quantile(std::move(values), 0.5); }

}  // namespace supertac::bench
