#ifndef SUPERTAC_REAL_IS_DOUBLE
#include <immintrin.h>

#include "autograd/kernels/fast/isa.h"

namespace supertac::kernels {
namespace {

constexpr int kTilePixels = 8;  // 8 x 2 accumulators: twice what hides FMA's latency of 4 on two ports
constexpr int kNarrowTilePixels = 12;
constexpr int kOuterRows = 8;

struct Vec {
  static constexpr Dim kLanes = 16;
  __m512 v;
  static __mmask16 mask(Dim n) { return static_cast<__mmask16>((1U << n) - 1U); }
  static Vec load(const real* p) { return {_mm512_loadu_ps(p)}; }
  static Vec load_part(const real* p, Dim n) { return {_mm512_maskz_loadu_ps(mask(n), p)}; }
  static Vec broadcast(real x) { return {_mm512_set1_ps(x)}; }
  static Vec add(Vec a, Vec b) { return {_mm512_add_ps(a.v, b.v)}; }
  static Vec sub(Vec a, Vec b) { return {_mm512_sub_ps(a.v, b.v)}; }
  static Vec fma(Vec a, Vec b, Vec c) { return {_mm512_fmadd_ps(a.v, b.v, c.v)}; }
  static Vec rectify(Vec x, Vec slope) {
    return {_mm512_mask_mul_ps(x.v, _mm512_cmp_ps_mask(x.v, _mm512_setzero_ps(), _CMP_NGT_UQ), slope.v, x.v)};
  }
  void store(real* p) const { _mm512_storeu_ps(p, v); }
  void store_part(real* p, Dim n) const { _mm512_mask_storeu_ps(p, mask(n), v); }
};

#include "autograd/kernels/fast/isa_kernels.inl"
#include "autograd/kernels/fast/isa_winograd.inl"

}  // namespace

const IsaKernels kAvx512Kernels{"avx512", Vectors::avx512, gather,  gather_rows, outer,
                                filters,  filter_grads,    patches, squares,     square_grads};

}  // namespace supertac::kernels

#endif  // SUPERTAC_REAL_IS_DOUBLE
