#ifndef SUPERTAC_REAL_IS_DOUBLE
#include <immintrin.h>

#include "autograd/kernels/fast/isa/isa.h"

namespace supertac::kernels {
namespace {

constexpr int kTilePixels = 6;  // 6 x 2 accumulators, 2 weights, 1 value: 15 of 16 registers
constexpr int kNarrowTilePixels = 12;
constexpr int kOuterRows = 4;
constexpr int kPlaneRows = 4;

alignas(32) const std::int32_t kLaneMask[16] = {-1, -1, -1, -1, -1, -1, -1, -1, 0, 0, 0, 0, 0, 0, 0, 0};

struct Vec {
  static constexpr Dim kLanes = 8;
  __m256 v;
  static __m256i mask(Dim n) {
    return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(kLaneMask + 8 - n));
  }
  static Vec load(const real* p) { return {_mm256_loadu_ps(p)}; }
  static Vec load_part(const real* p, Dim n) { return {_mm256_maskload_ps(p, mask(n))}; }
  static Vec broadcast(real x) { return {_mm256_set1_ps(x)}; }
  static Vec add(Vec a, Vec b) { return {_mm256_add_ps(a.v, b.v)}; }
  static Vec sub(Vec a, Vec b) { return {_mm256_sub_ps(a.v, b.v)}; }
  static Vec fma(Vec a, Vec b, Vec c) { return {_mm256_fmadd_ps(a.v, b.v, c.v)}; }
  static Vec rectify(Vec x, Vec slope, Vec floor) {
    const __m256 positive = _mm256_cmp_ps(x.v, _mm256_setzero_ps(), _CMP_GT_OQ);
    return {_mm256_blendv_ps(_mm256_mul_ps(slope.v, _mm256_max_ps(floor.v, x.v)), x.v, positive)};
  }
  /// to[j * to_step + i] = from[i * from_step + j]
  static void transpose(const real* from, Dim from_step, real* to, Dim to_step) {
    __m256 a[8], b[8];
    for (Dim i = 0; i < 8; ++i) a[i] = _mm256_loadu_ps(from + i * from_step);
    for (int i = 0; i < 8; i += 2) {
      b[i] = _mm256_unpacklo_ps(a[i], a[i + 1]);
      b[i + 1] = _mm256_unpackhi_ps(a[i], a[i + 1]);
    }
    for (int i = 0; i < 8; i += 4) {
      a[i] = _mm256_shuffle_ps(b[i], b[i + 2], 0x44);
      a[i + 1] = _mm256_shuffle_ps(b[i], b[i + 2], 0xEE);
      a[i + 2] = _mm256_shuffle_ps(b[i + 1], b[i + 3], 0x44);
      a[i + 3] = _mm256_shuffle_ps(b[i + 1], b[i + 3], 0xEE);
    }
    for (Dim i = 0; i < 4; ++i) {
      _mm256_storeu_ps(to + i * to_step, _mm256_permute2f128_ps(a[i], a[i + 4], 0x20));
      _mm256_storeu_ps(to + (i + 4) * to_step, _mm256_permute2f128_ps(a[i], a[i + 4], 0x31));
    }
  }
  void store(real* p) const { _mm256_storeu_ps(p, v); }
  void store_part(real* p, Dim n) const { _mm256_maskstore_ps(p, mask(n), v); }
};

#include "autograd/kernels/fast/isa/set.inl"

}  // namespace

constinit const IsaKernels kAvx2Kernels = set_of("avx2", Vectors::avx2);

}  // namespace supertac::kernels

#endif  // SUPERTAC_REAL_IS_DOUBLE
