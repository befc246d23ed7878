#ifndef SUPERTAC_REAL_IS_DOUBLE
#include <immintrin.h>

#include "autograd/kernels/fast/isa/isa.h"

namespace supertac::kernels {
namespace {

constexpr int kTilePixels = 8;  // 8 x 2 accumulators: twice what hides FMA's latency of 4 on two ports
constexpr int kNarrowTilePixels = 12;
constexpr int kOuterRows = 8;
constexpr int kPlaneRows = 8;

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
  static Vec rectify(Vec x, Vec slope, Vec floor) {
    const __mmask16 rest = _mm512_cmp_ps_mask(x.v, _mm512_setzero_ps(), _CMP_NGT_UQ);
    return {_mm512_mask_mul_ps(x.v, rest, slope.v, _mm512_max_ps(floor.v, x.v))};
  }
  /// to[j * to_step + i] = from[i * from_step + j]
  static void transpose(const real* from, Dim from_step, real* to, Dim to_step) {
    __m512 a[16], b[16];
    for (Dim i = 0; i < 16; ++i) a[i] = _mm512_loadu_ps(from + i * from_step);
    for (int i = 0; i < 16; i += 2) {
      b[i] = _mm512_unpacklo_ps(a[i], a[i + 1]);
      b[i + 1] = _mm512_unpackhi_ps(a[i], a[i + 1]);
    }
    for (int i = 0; i < 16; i += 4) {  // a[i + k]: column k of every group of four, rows i .. i + 3
      a[i] = _mm512_shuffle_ps(b[i], b[i + 2], 0x44);
      a[i + 1] = _mm512_shuffle_ps(b[i], b[i + 2], 0xEE);
      a[i + 2] = _mm512_shuffle_ps(b[i + 1], b[i + 3], 0x44);
      a[i + 3] = _mm512_shuffle_ps(b[i + 1], b[i + 3], 0xEE);
    }
    for (Dim k = 0; k < 4; ++k) {
      const __m512 even = _mm512_shuffle_f32x4(a[k], a[k + 4], 0x88);
      const __m512 odd = _mm512_shuffle_f32x4(a[k], a[k + 4], 0xDD);
      const __m512 even2 = _mm512_shuffle_f32x4(a[k + 8], a[k + 12], 0x88);
      const __m512 odd2 = _mm512_shuffle_f32x4(a[k + 8], a[k + 12], 0xDD);
      _mm512_storeu_ps(to + k * to_step, _mm512_shuffle_f32x4(even, even2, 0x88));
      _mm512_storeu_ps(to + (k + 4) * to_step, _mm512_shuffle_f32x4(odd, odd2, 0x88));
      _mm512_storeu_ps(to + (k + 8) * to_step, _mm512_shuffle_f32x4(even, even2, 0xDD));
      _mm512_storeu_ps(to + (k + 12) * to_step, _mm512_shuffle_f32x4(odd, odd2, 0xDD));
    }
  }
  void store(real* p) const { _mm512_storeu_ps(p, v); }
  void store_part(real* p, Dim n) const { _mm512_mask_storeu_ps(p, mask(n), v); }
};

#include "autograd/kernels/fast/isa/set.inl"

// Few outputs by vectors of eight: half of sixteen would be idle, and masks cost more than the wider set
// gains.
template <auto kWide, auto kNarrow, class Job, class... Rest>
void by_width(const Job& job, Rest... rest) {
  job.cout <= Vec::kLanes / 2 ? (kAvx2Kernels.*kNarrow)(job, rest...) : kWide(job, rest...);
}

constexpr IsaKernels with_narrow_outputs(IsaKernels set) {
  set.gather = by_width<gather, &IsaKernels::gather>;
  set.gather_rows = by_width<gather_rows, &IsaKernels::gather_rows>;
  set.outer = by_width<outer, &IsaKernels::outer>;
  set.product = by_width<product, &IsaKernels::product>;
  return set;
}

}  // namespace

constinit const IsaKernels kAvx512Kernels = with_narrow_outputs(set_of("avx512", Vectors::avx512));

}  // namespace supertac::kernels

#endif  // SUPERTAC_REAL_IS_DOUBLE
