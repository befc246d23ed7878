// The texture classifier: names the plate under the finger from one frame (4x4), one picture (16x16), or
// numbers that are no picture (latents).
#pragma once

#include <optional>

#include "layers/convolution.h"
#include "layers/linear.h"

namespace supertac {

struct ClassifierSettings {
  Dim height = 16, width = 16;  ///< pixels, 1 to 2048
  Dim channels = 1;             ///< of the input, at least 1
  Dim classes = 6;              ///< 2 to 1024
};

/// Two blocks (3x3 convolution, ReLU, max-pool 2) of 16 and 32 channels, then a linear layer. Where a side
/// has fewer than four pixels nothing can be pooled: a linear layer to 64 and ReLU stand in the blocks'
/// place. x [N,height,width,channels] -> logits [N,classes]; train with softmax_cross_entropy.
class TextureClassifier : public Module {
 public:
  /// Throws std::invalid_argument for settings out of range.
  TextureClassifier(const ClassifierSettings& settings, Rng& rng);
  Variable forward(const Variable& x) const;

 private:
  std::optional<Conv2d> first_, second_;
  std::optional<Linear> hidden_, out_;
};

}  // namespace supertac
