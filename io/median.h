#pragma once

#include <algorithm>
#include <cstddef>

namespace supertac {

/// The middle one of some numbers, the upper of two; reorders them. There must be at least one.
template <class Range>
auto median(Range&& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace supertac
