// Google Benchmark of a piece of work beside the FMA loop, turn by turn.
#pragma once

#include <benchmark/benchmark.h>

#include <algorithm>
#include <vector>

#include "bench/fma_peak.h"
#include "bench/median.h"

namespace supertac::bench {

/// Runs `work` (of `macs` multiply-adds, on the calling thread) in turns of at least 50 us, each followed by
/// the FMA loop; times are cpu_seconds(). The time of an iteration is that of one call. Counters are medians
/// over the turns: microseconds of a call, GFLOP/s, the share of the peak measured in the same turn, and that
/// peak.
template <class Work>
void run_against_peak(benchmark::State& state, double macs, Work&& work) {
  constexpr double kTurn = 50e-6;
  work();
  double begin = cpu_seconds();
  work();
  const int calls = std::max(1, static_cast<int>(kTurn / std::max(cpu_seconds() - begin, 1e-9)));
  std::vector<double> times, peaks, shares;
  for (auto _ : state) {
    begin = cpu_seconds();
    for (int i = 0; i < calls; ++i) work();
    const double seconds = (cpu_seconds() - begin) / calls;
    state.SetIterationTime(seconds);
    times.push_back(seconds);
    peaks.push_back(fma_gflops());
    shares.push_back(2 * macs / seconds * 1e-9 / peaks.back());
  }
  state.counters["us"] = median(times) * 1e6;
  state.counters["GFLOP/s"] = 2 * macs / median(times) * 1e-9;
  state.counters["share"] = median(shares);
  state.counters["peak"] = median(peaks);
}

}  // namespace supertac::bench
