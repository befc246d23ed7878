// When a loss is not finite: where in the network it began.
#pragma once

#include <string>
#include <vector>

#include "layers/module.h"

namespace supertac {

/// The first value in the order of computation that is not finite, in words: "parameter upsampler.out.bias is
/// not finite", "an input of conv1d in encoder.0.conv.0 is not finite" or "the output of conv2d in
/// upsampler.rirb.0.conv is the first that is not finite". An op without parameters is said to be behind the
/// last layer before it. Empty when all values of the loss's graph are finite, or backward() has freed them.
std::string where_not_finite(const Variable& loss, const std::vector<Parameter>& parameters);

/// The parameter nearest to the loss whose gradient is not finite, its name; empty when all are.
std::string gradient_not_finite(const std::vector<Parameter>& parameters);

}  // namespace supertac
