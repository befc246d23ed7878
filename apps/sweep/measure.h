// What a model costs to run, on this machine.
#pragma once

#include "models/supertac_model.h"

namespace supertac {

struct Latency {
  double median_us = 0, p99_us = 0;
};

/// Processor time of single windows (batch 1, one thread), warm: what a clock on the wall shows on an idle
/// machine, without the turns that other programs take on a busy one.
Latency measure_latency(const SuperTac& model);

/// The largest resident memory (MB) of this process since reset_peak_memory(); 0 where /proc does not say.
double peak_memory_mb();
void reset_peak_memory();

}  // namespace supertac
