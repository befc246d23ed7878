// Simple loops, compiled for several instruction sets and run on the one that isa_kernels() has chosen.
//
// Only for loops of separate multiplications and additions (-ffp-contract=off): their bits are the same at
// any vector width. Fused multiply-adds and sums of them live in isa/kernels.inl.
#pragma once

#include "autograd/kernels/fast/isa/isa.h"

namespace supertac::kernels {

#ifdef __x86_64__
// `flatten` takes what the loop calls into the function, so that it is compiled for the same set.
template <class Loop>
__attribute__((flatten, target("avx2"))) void run_on_avx2(Loop loop) {
  loop();
}

template <class Loop>
__attribute__((flatten, target("avx512f"))) void run_on_avx512(Loop loop) {
  loop();
}
#endif

/// Calls loop() as compiled for the chosen set: run_loop([=] { any loops });
template <class Loop>
void run_loop(Loop loop) {
#ifdef __x86_64__
  const Vectors vectors = isa_kernels().vectors;
  if (vectors == Vectors::avx512) return run_on_avx512(loop);
  if (vectors == Vectors::avx2) return run_on_avx2(loop);
#endif
  loop();
}

/// The loop of each(), for use inside run_loop().
template <class Body>
void each_here(Dim n, Body body) {
#ifdef __clang__
#pragma clang loop vectorize(assume_safety)
#else
#pragma GCC ivdep
#endif
  for (Dim i = 0; i < n; ++i) body(i);
}

/// each(n, [=](Dim i) { y[i] = a[i] + b[i]; }) for all i below n. No iteration may read what another one
/// writes.
template <class Body>
void each(Dim n, Body body) {
  run_loop([=] { each_here(n, body); });
}

/// Calls loop(put), put(i, value) being gx[i] = or += value, where that gradient is wanted.
template <class Loop>
void write_into(Slot gx, Loop loop) {
  real* const to = gx.data;
  if (!gx) return;
  gx.into == Into::add ? loop([to](Dim i, real value) { to[i] += value; })
                       : loop([to](Dim i, real value) { to[i] = value; });
}

/// gx[i] = or += term(i) for all i below n.
template <class Term>
void each_into(Dim n, Slot gx, Term term) {
  write_into(gx, [=](auto put) { each(n, [=](Dim i) { put(i, term(i)); }); });
}

/// The sum of term(i) over [0, n) in double precision: 16 partial sums that are added in a fixed order, so
/// that its bits do not depend on the width of vectors.
template <class Term>
double sum_of(Dim n, Term term) {
  constexpr Dim kParts = 16;
  double total = 0;
  run_loop([&, n] {
    double part[kParts] = {};
    Dim i = 0;
    for (; i + kParts <= n; i += kParts) {
      for (Dim j = 0; j < kParts; ++j) part[j] += static_cast<double>(term(i + j));
    }
    for (Dim j = 0; i < n; ++i, ++j) part[j] += static_cast<double>(term(i));
    for (Dim j = 0; j < kParts; ++j) total += part[j];
  });
  return total;
}

}  // namespace supertac::kernels
