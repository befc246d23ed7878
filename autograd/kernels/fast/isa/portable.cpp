// Scalar kernels: plain C++ with fused multiply-add. Compiled twice, see CMakeLists.txt: for any
// processor, and (SUPERTAC_SCALAR_FMA) for those whose FMA instruction takes one instruction, not a call.
#include "autograd/kernels/fast/isa/isa.h"

namespace supertac::kernels {
namespace {

constexpr int kTilePixels = 4;
constexpr int kNarrowTilePixels = 8;
constexpr int kOuterRows = 4;
constexpr int kPlaneRows = 4;

struct Vec {
  static constexpr Dim kLanes = 1;
  real v;
  static Vec load(const real* p) { return {*p}; }
  static Vec load_part(const real* p, Dim) { return {*p}; }
  static Vec broadcast(real x) { return {x}; }
  static Vec add(Vec a, Vec b) { return {a.v + b.v}; }
  static Vec sub(Vec a, Vec b) { return {a.v - b.v}; }
#ifdef SUPERTAC_REAL_IS_DOUBLE
  static Vec fma(Vec a, Vec b, Vec c) { return {__builtin_fma(a.v, b.v, c.v)}; }
#else
  static Vec fma(Vec a, Vec b, Vec c) { return {__builtin_fmaf(a.v, b.v, c.v)}; }
#endif
  static Vec rectify(Vec x, Vec slope, Vec floor) {
    return {x.v > 0 ? x.v : slope.v * (floor.v > x.v ? floor.v : x.v)};
  }
  static void transpose(const real* from, Dim, real* to, Dim) { *to = *from; }
  void store(real* p) const { *p = v; }
  void store_part(real* p, Dim) const { *p = v; }
};

#include "autograd/kernels/fast/isa/set.inl"

}  // namespace

#ifdef SUPERTAC_SCALAR_FMA
constinit const IsaKernels kPortableFmaKernels = set_of("portable", Vectors::baseline);
#else
constinit const IsaKernels kPortableKernels = set_of("portable", Vectors::baseline);
#endif

}  // namespace supertac::kernels
