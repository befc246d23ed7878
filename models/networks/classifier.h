// The texture classifiers: name the plate under the finger from one frame (4x4), one picture (16x16), or
// numbers that are no picture (latents).
#pragma once

#include "layers/convolution.h"
#include "layers/linear.h"

namespace supertac {

struct ClassifierSettings {
  Dim height = 16, width = 16;  ///< pixels, 4 to 2048
  Dim channels = 1;             ///< of the input, at least 1
  Dim classes = 6;              ///< 2 to 1024
};

/// Two blocks (3x3 convolution, ReLU, max-pool 2) of 16 and 32 channels, then a linear layer.
/// x [N,height,width,channels] -> logits [N,classes]; train with softmax_cross_entropy.
class TextureClassifier : public Module {
 public:
  /// Throws std::invalid_argument for settings out of range.
  TextureClassifier(const ClassifierSettings& settings, Rng& rng);
  Variable forward(const Variable& x) const;

 private:
  Conv2d first_, second_;
  Linear out_;
};

/// For inputs without neighbours: a linear layer to 64, ReLU, and one to the classes.
/// x [N,features] -> logits [N,classes].
class FeatureClassifier : public Module {
 public:
  /// Throws std::invalid_argument for no feature, or unless there are 2 to 1024 classes.
  FeatureClassifier(Dim features, Dim classes, Rng& rng);
  Variable forward(const Variable& x) const;

 private:
  Linear hidden_, out_;
};

}  // namespace supertac
