// The kernels that are compiled once per instruction set, and the choice between them at run time.
//
// All variants add up each output in the same order with fused multiply-add, so they give the same
// bits; they differ in how many outputs they work on at once.
#pragma once

#include <string_view>

#include "autograd/kernels/geometry.h"

namespace supertac::kernels {

/// y[q, :] = bias + sum over taps, cin of x[source(tap, q), cin] * w[tap, cin, :]   for one image.
struct GatherJob {
  const std::vector<Phase>* phases = nullptr;
  const real* w = nullptr;     // [taps][cin][cout]
  const real* bias = nullptr;  // [cout] or null
  Dim cin = 0, cout = 0;
  bool accumulate = false;  // add to what is in y instead of overwriting it
};

/// gw[cin, cout] += sum over images, pairs of x[image, input(pair), cin] * gy[image, output(pair), cout],
/// for kOuterRows values of cin from `row` on and all values of cout.
struct OuterJob {
  const TapPairs* pairs = nullptr;
  const real* x = nullptr;   // [images][in_pixels][cin]
  const real* gy = nullptr;  // [images][out_pixels][cout]
  real* gw = nullptr;        // [cin][cout], this tap's
  Dim images = 0, in_pixels = 0, out_pixels = 0, cin = 0, cout = 0;
  Dim chunk =
      1;  // images that are summed up on their own before they are added to gw; depends on shapes only
};
inline constexpr Dim kOuterRows = 8;
/// The largest number of input channels that `gather` takes (the length of its row of zeros).
inline constexpr Dim kMaxChannels = 4096;

struct IsaKernels {
  std::string_view name;
  void (*gather)(const GatherJob& job, const real* x, real* y);
  /// `rows` images of one pixel each: y[rows, cout] = bias + x[rows, cin] * w[cin, cout]
  void (*gather_rows)(const GatherJob& job, const real* x, real* y, Dim rows);
  void (*outer)(const OuterJob& job, Dim row);
};

/// The best set this processor has, or the one that SUPERTAC_ISA=avx512|avx2|portable names.
/// Throws std::runtime_error, at first use, when SUPERTAC_ISA names an unknown or unsupported set.
const IsaKernels& isa_kernels();

extern const IsaKernels kPortableKernels;  // any processor; fused multiply-add in software where it has none
extern const IsaKernels kPortableFmaKernels;  // the same source for processors with scalar FMA
#ifndef SUPERTAC_REAL_IS_DOUBLE
extern const IsaKernels kAvx2Kernels;
extern const IsaKernels kAvx512Kernels;
#endif

}  // namespace supertac::kernels
