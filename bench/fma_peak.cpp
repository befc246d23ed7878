#include "bench/fma_peak.h"

#include <immintrin.h>

#include <stdexcept>

#include "io/numbers/clock.h"

namespace supertac::bench {
namespace {

// Enough independent sums to hide the latency of 4 cycles on two units, few enough for 16 registers.
constexpr int kSums = 12;
constexpr long kSteps = 2000;
volatile float sink;

// Each runs kSteps * kSums operations and returns how many floating-point ones those are.
using Loop = double (*)();

__attribute__((target("avx512f"))) double loop_avx512() {
  __m512 sum[kSums];
  const __m512 factor = _mm512_set1_ps(0.999F);
  for (auto& s : sum) s = factor;
  for (long i = 0; i < kSteps; ++i) {
#pragma GCC unroll 12
    for (int k = 0; k < kSums; ++k) sum[k] = _mm512_fmadd_ps(sum[k], factor, factor);
  }
  for (int k = 1; k < kSums; ++k) sum[0] = _mm512_add_ps(sum[0], sum[k]);
  sink = _mm512_cvtss_f32(sum[0]);
  return 2.0 * 16 * kSums * kSteps;
}

__attribute__((target("avx2,fma"))) double loop_avx2() {
  __m256 sum[kSums];
  const __m256 factor = _mm256_set1_ps(0.999F);
  for (auto& s : sum) s = factor;
  for (long i = 0; i < kSteps; ++i) {
#pragma GCC unroll 12
    for (int k = 0; k < kSums; ++k) sum[k] = _mm256_fmadd_ps(sum[k], factor, factor);
  }
  for (int k = 1; k < kSums; ++k) sum[0] = _mm256_add_ps(sum[0], sum[k]);
  sink = _mm256_cvtss_f32(sum[0]);
  return 2.0 * 8 * kSums * kSteps;
}

Loop best_loop() {
  if (__builtin_cpu_supports("avx512f")) return loop_avx512;
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return loop_avx2;
  throw std::runtime_error("this processor has no AVX2 and FMA, whose peak the benchmarks compare with");
}

}  // namespace

double cpu_seconds() { return seconds_of(CLOCK_THREAD_CPUTIME_ID); }

double fma_gflops() {
  constexpr int kCalls = 8;
  static const Loop loop = best_loop();
  loop();  // the first wide instructions after a pause run slowly
  double operations = 0;
  const double begin = cpu_seconds();
  for (int i = 0; i < kCalls; ++i) operations += loop();
  return operations / (cpu_seconds() - begin) * 1e-9;
}

}  // namespace supertac::bench
