#include "apps/sweep/measure.h"

#include <time.h>

#include <algorithm>
#include <fstream>
#include <sstream>
#include <vector>

#include "io/random.h"

namespace supertac {
namespace {

constexpr int kWarmUp = 100, kWindows = 2000;

double thread_seconds() {
  timespec t{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

}  // namespace

Latency measure_latency(const SuperTac& model) {
  Tensor window(Shape{1, model.settings().timesteps, model.settings().signals()});
  const RandomStream random(0, 0);
  std::uint64_t i = 0;
  for (real& x : window.values()) x = static_cast<real>(random.uniform(i++));
  for (int n = 0; n < kWarmUp; ++n) model.infer(window);
  std::vector<double> seconds(kWindows);
  for (double& s : seconds) {
    const double begin = thread_seconds();
    model.infer(window);
    s = thread_seconds() - begin;
  }
  std::sort(seconds.begin(), seconds.end());
  return {.median_us = 1e6 * seconds[kWindows / 2], .p99_us = 1e6 * seconds[kWindows * 99 / 100]};
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
