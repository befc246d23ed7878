// Simple loops, compiled for several instruction sets and run on the one that isa_kernels() has chosen.
//
// Only for loops of separate multiplications and additions (-ffp-contract=off): their bits are the same at
// any vector width. Sums and fused multiply-adds live in isa/kernels.inl.
#pragma once

#include "autograd/kernels/fast/isa/isa.h"

/// Of a lambda for run_loop(): it must be inlined to be compiled for the set.
#define SUPERTAC_LOOP __attribute__((always_inline))

/// Before a for: no turn reads what another one writes, so none need be looked for at run time.
#ifdef __clang__
#define SUPERTAC_INDEPENDENT _Pragma("clang loop vectorize(assume_safety)")
#else
#define SUPERTAC_INDEPENDENT _Pragma("GCC ivdep")
#endif

namespace supertac::kernels {

#ifdef __x86_64__
template <class Loop>
__attribute__((target("avx2"))) void run_on_avx2(Loop loop) {
  loop();
}

template <class Loop>
__attribute__((target("avx512f"))) void run_on_avx512(Loop loop) {
  loop();
}
#endif

/// run_loop([=]() SUPERTAC_LOOP { any loops });
template <class Loop>
void run_loop(Loop loop) {
#ifdef __x86_64__
  const Vectors vectors = isa_kernels().vectors;
  if (vectors == Vectors::avx512) return run_on_avx512(loop);
  if (vectors == Vectors::avx2) return run_on_avx2(loop);
#endif
  loop();
}

/// each(n, [=](Dim i) SUPERTAC_LOOP { y[i] = a[i] + b[i]; }) for all i below n.
template <class Body>
void each(Dim n, Body body) {
  run_loop([=]() SUPERTAC_LOOP {
    SUPERTAC_INDEPENDENT
    for (Dim i = 0; i < n; ++i) body(i);
  });
}

}  // namespace supertac::kernels
