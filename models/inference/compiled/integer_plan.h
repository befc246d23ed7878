// A network in whole numbers (int8), as data: the steps that supertac-export writes as C for microcontrollers
// (models/files/exports.h). A PC runs the same C (kernels.c), so that both draw the same bits.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "models/inference/compiled/compiled_model.h"
#include "models/networks/supertac_model.h"

namespace supertac {

/// What kernels.c works on, as a microcontroller's program has it.
namespace c99 {
#include "models/inference/compiled/kernel_types.c"
}

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

  // Of a product, whose pointers are to the two behind it: a step may be moved, but not copied.
  c99::product product = {};
  std::vector<c99::outcome> outcomes = {};
  /// Of bytes w + 128, [cout / 4][rows / 4][4 outputs][4], filled up to whole fours of outputs; of numbers
  /// [cout][rows].
  std::vector<std::uint8_t> weights = {};

  static constexpr std::int16_t kNoSlope = 4096;
};

struct IntegerPlan {
  /// Throws std::logic_error naming an op that has no step, std::invalid_argument for the ranges of another
  /// network, std::runtime_error for a layer that kernels.c cannot count in 16 bits.
  static std::shared_ptr<const IntegerPlan> of(const SuperTac& network, const ActivationRanges& ranges);
  /// Draws what `out` has room for; inputs as SuperTac::estimate, which is not checked.
  void run(const Tensor& inputs, Estimate& out) const;
  float number_step() const;
  const c99::map& map(int i) const { return maps[static_cast<std::size_t>(i)]; }

  std::vector<c99::map> maps;
  std::vector<IntegerStep> steps;
  int fraction_bits = 0;
  Dim work_area = 0;                                     ///< bytes of an image
  int picture = -1, predicted_error = -1, latents = -1;  ///< maps; -1: the network has none
};

}  // namespace supertac
