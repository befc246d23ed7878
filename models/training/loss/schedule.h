// The learning rate over a training.
#pragma once

#include <cstdint>

namespace supertac {

/// The learning rate at `step` (from 0) of `total`: a linear rise over `warm_up` steps to `peak`, then half a
/// cosine down to 0 (Loshchilov & Hutter 2017, eq. 5, one period).
struct Schedule {
  double peak = 1e-3;
  std::int64_t warm_up = 0;
  std::int64_t total = 1;
  double at(std::int64_t step) const;
};

}  // namespace supertac
