// The kernels that are compiled once per instruction set, and the choice between them at run time.
//
// All variants add up each output in the same order with fused multiply-add, so they give the same
// bits; they differ in how many outputs they work on at once.
#pragma once

#include <string_view>
#include <vector>

#include "autograd/kernels/fast/geometry.h"
#include "autograd/kernels/fast/inference.h"

namespace supertac::kernels {

/// y[q, :] = f(bias + sum over taps, cin of x[source(tap, q), cin] * w[tap, cin, :])   for one image, with
/// f(s) = s for s > 0, else negative_slope * s.
struct GatherJob {
  const std::vector<Phase>* phases = nullptr;
  const real* w = nullptr;     // [taps][cin][cout]
  const real* bias = nullptr;  // [cout] or null
  Dim cin = 0, cout = 0;
  Into into = Into::overwrite;  // add: start from what is in y instead of the bias
  real negative_slope = 1;      // 1: f is the identity
};

/// gw[cin, cout] = or += the sum over images, then pairs, of x[image, input(pair), cin] * gy[image,
/// output(pair), cout]. The sum is taken on its own before it is added to gw, or to 0.
struct OuterJob {
  const TapPairs* pairs = nullptr;
  const real* x = nullptr;   // [images][in_pixels][cin]
  const real* gy = nullptr;  // [images][out_pixels][cout]
  real* gw = nullptr;        // [cin][cout], this tap's
  Dim images = 0, in_pixels = 0, out_pixels = 0, cin = 0, cout = 0;
  Into into = Into::add;
};
/// Tiles of square x square pixels of maps for Winograd's transforms (winograd.cpp), numbered through a batch
/// from `first` on, `count` of them. Place (i, j) of the k-th of them is
///   places[((square + 2) i + j) * step + k * channels + c]
struct TileJob {
  Dim tiles_down = 0, tiles_across = 0;  // of an image
  Strides map;
  Dim channels = 0;     // a multiple of kTransformChannels
  Dim square = 4;       // or 2
  bool margin = false;  // whether zeros lie around each image, else the kernels put them there
  Dim first = 0, count = 0, step = 0;
};
inline constexpr Dim kTransformChannels = 16;
/// Numbers from one place of so many tiles to the next: a power of two apart, the places of a tile would
/// share few sets of the first cache.
inline constexpr Dim place_step(Dim tiles, Dim channels) { return tiles * channels + 16; }

/// Filters g [3][3][weights], `weights` = cin * cout, and their places for the same transforms: place (i, j)
/// of weight k is u[((square + 2) i + j) * step + k].
struct FilterJob {
  Dim weights = 0;        // a multiple of kTransformChannels
  Dim step = 0;           // numbers from one place to the next, `weights` or more
  Dim square = 4;         // pixels of an output tile each way: 4, or 2
  Into into = Into::add;  // of filter_grads
};

/// Instructions that plain loops (each.h) are compiled for.
enum class Vectors { baseline, avx2, avx512 };

/// The kernels of one instruction set. Arrays are the caller's; sizes count numbers of `real`.
struct IsaKernels {
  std::string_view name;
  Vectors vectors = Vectors::baseline;
  void (*gather)(const GatherJob& job, const real* x, real* y) = nullptr;
  /// `rows` images of one pixel each: y[rows, cout] = bias + x[rows, cin] * w[cin, cout]
  void (*gather_rows)(const GatherJob& job, const real* x, real* y, Dim rows) = nullptr;
  void (*outer)(const OuterJob& job) = nullptr;
  /// u = G g G^T, and g = or += G^T u G
  void (*filters)(const FilterJob& job, const real* g, real* u) = nullptr;
  void (*filter_grads)(const FilterJob& job, const real* u, real* g) = nullptr;
  /// places = B^T d B of the patches d of x, each a tile and the pixels around
  void (*patches)(const TileJob& job, const real* x, real* places) = nullptr;
  /// y = f(start + A^T m A) of the places m; start is the bias, y itself (Into::add) or, without a bias, 0
  void (*squares)(const TileJob& job, const real* places, const real* bias, Into into, real negative_slope,
                  real* y) = nullptr;
  /// places = A g A^T of the squares g of gy, of 4x4
  void (*square_grads)(const TileJob& job, const real* gy, real* places) = nullptr;

  /// to[j * to_step + i] = from[i * from_step + j] for i < rows, j < columns
  void (*transpose)(Dim rows, Dim columns, const real* from, Dim from_step, real* to, Dim to_step) = nullptr;

  // Of compiled models, see inference.h. `x` of plane_conv begins with the margin.
  void (*product)(const ProductJob& job, const real* x, real* y) = nullptr;
  void (*places)(const PlacesJob& job, const real* v, const real* u, real* m) = nullptr;
  void (*gate)(const MapJob& job, const real* a, const real* x, const real* gates, real* y) = nullptr;
  void (*mean)(const MapJob& job, const real* x, real* means) = nullptr;
  void (*planes)(const PlaneJob& job, Dim x_line, const real* x, real* to) = nullptr;
  void (*plane_conv)(const PlaneJob& job, const real* x) = nullptr;
};

/// The best set this processor has, or the one that SUPERTAC_ISA=avx512|avx2|neon|portable|plain names.
/// Throws std::runtime_error, at first use, when SUPERTAC_ISA names an unknown or unsupported set.
const IsaKernels& isa_kernels();
/// All sets that this processor can run, the best first, kPlainKernels last.
std::vector<const IsaKernels*> supported_sets();
/// Replaces the choice, for those who compare the sets in one process; not while kernels run.
void use_isa(const IsaKernels& set);

/// Has no kernels: convolutions and linear layers run the loops of autograd/kernels/conv.cpp, all others
/// those of each.h.
extern const IsaKernels kPlainKernels;
inline bool is_plain() { return isa_kernels().gather == nullptr; }

extern const IsaKernels kPortableKernels;  // any processor; fused multiply-add in software where it has none
// Those below are built for the processors that can have them, all but the first for single precision only.
extern const IsaKernels kPortableFmaKernels;  // the portable source for x86 processors with scalar FMA
extern const IsaKernels kAvx2Kernels, kAvx512Kernels;
extern const IsaKernels kNeonKernels;

}  // namespace supertac::kernels
