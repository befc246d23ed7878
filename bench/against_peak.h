// Google Benchmark of a piece of work beside the FMA loop, turn by turn.
#pragma once

#include <benchmark/benchmark.h>

#include <algorithm>
#include <functional>
#include <vector>

#include "bench/fma_peak.h"
#include "io/numbers/median.h"

namespace supertac::bench {

/// cpu_seconds() of one call of `work`.
template <class Work>
double seconds_of(Work&& work, int calls = 1) {
  const double begin = cpu_seconds();
  for (int i = 0; i < calls; ++i) work();
  return (cpu_seconds() - begin) / calls;
}

/// Calls of `work` that fill a turn of 50 us; at least one.
template <class Work>
int calls_in_a_turn(Work&& work) {
  work();
  return std::max(1, static_cast<int>(50e-6 / std::max(seconds_of(work), 1e-9)));
}

/// Runs `work` (of `macs` multiply-adds, on the calling thread) in turns of at least 50 us, each followed by
/// the FMA loop. The time of an iteration is that of one call. Counters are medians over the turns:
/// microseconds of a call, GFLOP/s, the share of the peak measured in the same turn, and that peak. A
/// yardstick, if there is one, takes its turn with them: `yardstick` is its share of the peak.
template <class Work>
void run_against_peak(benchmark::State& state, double macs, Work&& work,
                      const std::function<void()>& yardstick = {}) {
  const int calls = calls_in_a_turn(work), yardstick_calls = yardstick ? calls_in_a_turn(yardstick) : 0;
  std::vector<double> times, peaks, shares, yardsticks;
  for (auto _ : state) {
    const double seconds = seconds_of(work, calls);
    state.SetIterationTime(seconds);
    times.push_back(seconds);
    peaks.push_back(fma_gflops());
    shares.push_back(2 * macs / seconds * 1e-9 / peaks.back());
    if (yardstick)
      yardsticks.push_back(2 * macs / seconds_of(yardstick, yardstick_calls) * 1e-9 / peaks.back());
  }
  state.counters["us"] = median(times) * 1e6;
  state.counters["GFLOP/s"] = 2 * macs / median(times) * 1e-9;
  state.counters["share"] = median(shares);
  state.counters["peak"] = median(peaks);
  if (yardstick) state.counters["yardstick"] = median(yardsticks);
}

}  // namespace supertac::bench
