// What a window costs, in multiply-adds.
#pragma once

#include "models/networks/supertac_model.h"

namespace supertac {

/// Multiply-adds of convolutions and linear layers for one window, counted the usual way: padding as if it
/// were data; biases, activations, sums and channel scaling left out.
struct Cost {
  double inference = 0;  ///< encoders (mean only) and upsampler
  double training = 0;   ///< forward with heads and decoders, and as much again for each of the two gradients
};

/// Throws as SuperTacSettings::check.
Cost cost_of(const SuperTacSettings& settings);

}  // namespace supertac
