// A network in whole numbers (int8), as data: the steps that supertac-export writes as C for microcontrollers
// (models/files/exports.h). A PC runs the same C (kernels.c), so that both draw the same bits.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "models/inference/compiled/compiled_model.h"
#include "models/inference/compiled/taps.h"
#include "models/networks/supertac_model.h"

namespace supertac {

/// A map, whose offset is in bytes and whose margin has the value that stands for 0, in memory that is reused
/// behind the last step that reads it. Either bytes, each map with a scale of its own, or numbers of 16 bits
/// in steps of 2^-fraction_bits, for what bytes would be too coarse for: sums of residual blocks, latents,
/// the picture.
struct IntegerMap : FeatureMap {
  bool bytes = false;
  Scale scale;

  Dim size() const { return image() * (bytes ? 1 : 2); }  // bytes
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

/// A call of a function of kernels.c:
///   take_input(input, y, InputRuns, multiplier, offset, shift)   y = runs of the network's input
///   to_bytes(x, y, multiplier, offset, shift)                    y = x in another scale
///   product_of_bytes(product, x, y), product_of_numbers(...)     a convolution or linear layer, or every
///                                                                second pixel of a transposed convolution
///   copy(x, y, channel)                                          y, from a channel on, = x without margin
///   mean(x, y)                                                   y = mean over the pixels of x
///   gates(x, y)                                                  y = sigmoid(x), in 4096ths
///   gated_sum(a, x, gates, y)                                    y = a + x * gates, or a + x
/// To another scale a number, up to 16 bits, becomes ((x * multiplier + offset) >> shift) + its zero.
struct IntegerStep {
  std::string function, name;              ///< "encoder.0.conv.1", or what it computes
  std::vector<int> maps = {};              ///< that it is given, -1: none; it writes the last one
  std::vector<std::int32_t> numbers = {};  ///< that it is given behind the maps
  bool writes_margin = false;              ///< the first step that writes a map: its margin is filled before

  // Of a product:
  ProductTaps taps = {};                   // all but w and bias
  QuantisedProduct weights = {};           // [segments * length][cout]
  std::int32_t negative_slope = kNoSlope;  // of 4096
  /// The weights as kernels.c takes them: of bytes w + 128, [cout / 4][rows / 4][4 outputs][4], filled up to
  /// whole fours of outputs; of numbers [cout][rows].
  std::vector<std::uint8_t> packed = {};

  static constexpr std::int32_t kNoSlope = 4096;
};

struct IntegerPlan {
  /// Throws std::logic_error naming an op that has no step, std::invalid_argument for the ranges of another
  /// network, std::runtime_error for a layer that kernels.c cannot count in 16 bits.
  static std::shared_ptr<const IntegerPlan> of(const SuperTac& network, const ActivationRanges& ranges);
  /// Draws what `out` has room for; inputs as SuperTac::estimate, which is not checked.
  void run(const Tensor& inputs, Estimate& out) const;
  float number_step() const;
  const IntegerMap& map(int i) const { return maps[static_cast<std::size_t>(i)]; }

  std::vector<IntegerMap> maps;
  std::vector<IntegerStep> steps;
  int fraction_bits = 0;
  Dim work_area = 0;                                     ///< bytes of an image
  int picture = -1, predicted_error = -1, latents = -1;  ///< maps; -1: the network has none

 private:
  struct Compiled;  // the steps with arguments as kernels.c has them
  void compile();

  std::shared_ptr<const Compiled> compiled_;
};

}  // namespace supertac
