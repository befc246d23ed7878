// The texture classifier: names the plate under the finger from one frame (4x4) or one picture (16x16).
#pragma once

#include "layers/convolution.h"
#include "layers/linear.h"

namespace supertac {

struct ClassifierSettings {
  Dim size = 16;    ///< pixels a side, at least 4
  Dim classes = 6;  ///< at least 2
};

/// Two blocks (3x3 convolution, ReLU, max-pool 2) of 16 and 32 channels, then a linear layer.
/// x [N,size,size,1] -> logits [N,classes]; train with softmax_cross_entropy.
class TextureClassifier : public Module {
 public:
  /// Throws std::invalid_argument for settings out of range.
  TextureClassifier(const ClassifierSettings& settings, Rng& rng);
  Variable forward(const Variable& x) const;

 private:
  Conv2d first_, second_;
  Linear out_;
};

}  // namespace supertac
