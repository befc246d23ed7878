#ifndef SUPERTAC_REAL_IS_DOUBLE
#include <arm_neon.h>

#include "autograd/kernels/fast/isa/isa.h"

namespace supertac::kernels {
namespace {

constexpr int kTilePixels = 6;  // 6 x 2 accumulators and more would fit: 32 registers
constexpr int kNarrowTilePixels = 12;
constexpr int kOuterRows = 4;
constexpr int kPlaneRows = 4;

struct Vec {
  static constexpr Dim kLanes = 4;
  float32x4_t v;
  static Vec load(const real* p) { return {vld1q_f32(p)}; }
  static Vec load_part(const real* p, Dim n) {
    real all[kLanes] = {};
    for (Dim i = 0; i < n; ++i) all[i] = p[i];
    return load(all);
  }
  static Vec broadcast(real x) { return {vdupq_n_f32(x)}; }
  static Vec add(Vec a, Vec b) { return {vaddq_f32(a.v, b.v)}; }
  static Vec sub(Vec a, Vec b) { return {vsubq_f32(a.v, b.v)}; }
  static Vec fma(Vec a, Vec b, Vec c) { return {vfmaq_f32(c.v, a.v, b.v)}; }
  static Vec rectify(Vec x, Vec slope, Vec floor) {
    const float32x4_t rest = vmulq_f32(slope.v, vmaxq_f32(floor.v, x.v));
    return {vbslq_f32(vcgtq_f32(x.v, vdupq_n_f32(0)), x.v, rest)};
  }
  /// to[j * to_step + i] = from[i * from_step + j]
  static void transpose(const real* from, Dim from_step, real* to, Dim to_step) {
    const float32x4x2_t a = vtrnq_f32(vld1q_f32(from), vld1q_f32(from + from_step));
    const float32x4x2_t b = vtrnq_f32(vld1q_f32(from + 2 * from_step), vld1q_f32(from + 3 * from_step));
    for (int i = 0; i < 2; ++i) {
      vst1q_f32(to + i * to_step, vcombine_f32(vget_low_f32(a.val[i]), vget_low_f32(b.val[i])));
      vst1q_f32(to + (i + 2) * to_step, vcombine_f32(vget_high_f32(a.val[i]), vget_high_f32(b.val[i])));
    }
  }
  void store(real* p) const { vst1q_f32(p, v); }
  void store_part(real* p, Dim n) const {
    real all[kLanes];
    store(all);
    for (Dim i = 0; i < n; ++i) p[i] = all[i];
  }
};

#include "autograd/kernels/fast/isa/set.inl"

}  // namespace

constinit const IsaKernels kNeonKernels = set_of("neon", Vectors::baseline);

}  // namespace supertac::kernels

#endif  // SUPERTAC_REAL_IS_DOUBLE
