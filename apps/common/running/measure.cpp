#include "apps/common/running/measure.h"

#include <fstream>
#include <sstream>
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

double peak_memory_mb() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (!line.starts_with("VmHWM:")) continue;
    double kilobytes = 0;
    std::istringstream(line.substr(6)) >> kilobytes;
    return kilobytes * 1024e-6;
  }
  return 0;
}

void reset_peak_memory() { std::ofstream("/proc/self/clear_refs") << "5"; }

}  // namespace supertac
