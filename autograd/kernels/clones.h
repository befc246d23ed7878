// Simple loops compiled for several instruction sets, the best chosen by the loader.
//
// Only for loops of separate multiplications and additions (-ffp-contract=off): their bits are the same at
// any vector width. Sums and fused multiply-adds live in isa_kernels.inl.
#pragma once

// The sanitizers' run time is not ready when the loader makes its choice.
#if defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) && \
    !defined(__clang__)
#define SUPERTAC_CLONES __attribute__((target_clones("arch=skylake-avx512", "avx2", "default")))
#else
#define SUPERTAC_CLONES
#endif
