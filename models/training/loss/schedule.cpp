#include "models/training/loss/schedule.h"

#include <algorithm>
#include <numbers>

namespace supertac {

// The Taylor series, since the last bits of the C library's cosine depend on the processor. For |x| <= pi the
// first term left out is below 1e-19.
static double series_of_cosine(double x) {
  double sum = 1, term = 1;
  for (int k = 2; k <= 30; k += 2) sum += term *= -x * x / (k * (k - 1));
  return sum;
}

double Schedule::at(std::int64_t step) const {
  if (step < warm_up) return peak * static_cast<double>(step + 1) / static_cast<double>(warm_up);
  if (total <= warm_up) return peak;
  const double done =
      std::min(1.0, static_cast<double>(step - warm_up) / static_cast<double>(total - warm_up));
  return peak * (1 + series_of_cosine(std::numbers::pi * done)) / 2;
}

}  // namespace supertac
