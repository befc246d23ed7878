// Convolution layers, channels-last, each with the activation behind it: see autograd/ops/convolution.h for
// the formulas and what is thrown.
#pragma once

#include "autograd/ops/convolution.h"
#include "layers/module.h"

namespace supertac {

struct ConvLayerOptions {
  Dim kernel = 3;
  Dim stride = 1;
  Dim padding = 0;
};

/// What the four layers share: a weight [kernel..., in, out] and a bias [out].
class ConvLayer : public Module {
 protected:
  ConvLayer(int dimensions, Dim in, Dim out, const ConvLayerOptions& options, Layout layout, Rng& rng);
  ConvOptions options(real negative_slope) const {
    return {.stride = options_.stride, .padding = options_.padding, .negative_slope = negative_slope};
  }

  ConvLayerOptions options_;
  Variable weight_, bias_;
};

/// x [N,L,in] -> [N, (L + 2 padding - kernel) / stride + 1, out]
class Conv1d : public ConvLayer {
 public:
  Conv1d(Dim in, Dim out, const ConvLayerOptions& options, Rng& rng);
  Variable forward(const Variable& x, real negative_slope = kNoActivation) const;
};

/// x [N,H,W,in] -> [N,H',W',out]
class Conv2d : public ConvLayer {
 public:
  Conv2d(Dim in, Dim out, const ConvLayerOptions& options, Rng& rng);
  Variable forward(const Variable& x, real negative_slope = kNoActivation) const;
};

/// x [N,L,in] -> [N, (L - 1) stride - 2 padding + kernel, out]
class ConvTranspose1d : public ConvLayer {
 public:
  ConvTranspose1d(Dim in, Dim out, const ConvLayerOptions& options, Rng& rng);
  Variable forward(const Variable& x, real negative_slope = kNoActivation) const;
};

/// x [N,H,W,in] -> [N,H',W',out]
class ConvTranspose2d : public ConvLayer {
 public:
  ConvTranspose2d(Dim in, Dim out, const ConvLayerOptions& options, Rng& rng);
  Variable forward(const Variable& x, real negative_slope = kNoActivation) const;
};

}  // namespace supertac
