// Weights as bytes, and the whole numbers that turn their sums into the next map's.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "autograd/tensor.h"

namespace supertac {

/// How whole numbers q stand for values: value = (q - zero) * step, |q| <= largest.
struct Scale {
  double step = 1;
  std::int32_t zero = 0;
  std::int32_t largest = 255;
};

/// Sums of a product: s[o] = sum over k of x[k] * w[k, o], where x are whole numbers of scale `from`, become
///   v[o] = (s[o] * multiplier[o] + offset[o]) >> shift[o]
/// in steps of `to`, zero not yet added. A weight's step is chosen so that multiplier / 2^shift is exact:
///   w = q * step_w[o],   step_w[o] = multiplier[o] / 2^shift[o] * to.step / from.step,   |q| <= 127
/// The multiplier has six bits, so that for sums of bytes nothing overflows 32 bits, in vectors or on a
/// microcontroller; of sums of 16-bit numbers the product takes 64.
struct QuantisedProduct {
  Dim rows = 0, outputs = 0;
  std::vector<std::int8_t> w;  // [rows][outputs]
  std::vector<std::int32_t> multiplier, offset, shift;
};
/// w [rows][outputs], bias [outputs].
QuantisedProduct quantise(Dim rows, std::span<const real> w, std::span<const real> bias, const Scale& from,
                          const Scale& to);

/// From numbers of one scale, up to 16 bits, to another one: ((x * multiplier + offset) >> shift) + zero of
/// the other one.
struct Requantise {
  std::int32_t multiplier = 1, offset = 0, shift = 0;
};
Requantise requantise(double from_step, double to_step);

}  // namespace supertac
