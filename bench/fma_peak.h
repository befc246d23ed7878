// The most multiply-adds that this core can do now: a loop that touches registers only, run on the widest
// instruction set of the processor. The clock of a busy machine changes all the time, so it is measured
// between the things that are compared with it.
#pragma once

namespace supertac::bench {

/// Processor time of the calling thread: what the clock on the wall shows on an idle machine, without the
/// turns that other programs take on a busy one.
double cpu_seconds();

/// GFLOP/s (two per multiply-add) over about 20 us of the calling thread. Throws std::runtime_error without
/// AVX2.
double fma_gflops();

}  // namespace supertac::bench
