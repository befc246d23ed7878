#include "apps/common/running/measure.h"

#include <vector>

#include "io/numbers/clock.h"
#include "io/numbers/median.h"

namespace supertac {
namespace {

constexpr int kWarmUp = 50, kPictures = 1000;

double thread_seconds() { return seconds_of(CLOCK_THREAD_CPUTIME_ID); }

}  // namespace

Latency measure_latency(const std::function<void()>& make_picture) {
  for (int n = 0; n < kWarmUp; ++n) make_picture();
  std::vector<double> seconds(kPictures);
  for (double& s : seconds) {
    const double begin = thread_seconds();
    make_picture();
    s = thread_seconds() - begin;
  }
  return {.median_us = 1e6 * median(seconds), .p99_us = 1e6 * quantile(seconds, 0.99)};
}

}  // namespace supertac
