// Super-resolution of single frames of any array, without a window of time: for pairs of images from
// elsewhere.
#pragma once

#include <vector>

#include "layers/residual.h"
#include "models/networks/network.h"

namespace supertac {

struct FrameSettings {
  Dim in_channels = 1;           ///< of the sensor: 1 to 64
  Dim height = 4, width = 4;     ///< of its array: 1 to 512
  Dim scale = 4;                 ///< 2, 4, 8 or 16
  Dim channels = 32, rcabs = 3;  ///< of the network, as in SuperTacSettings

  /// Throws std::invalid_argument naming the setting, its range and what was given.
  void check() const;
};

/// frame [N,H,W,C] -> picture [N,sH,sW,1], linear output: Conv2d C-channels k3 p1, LeakyReLU; log2(scale) x
/// RIRB; Conv2d channels-1 k3 p1. What SuperTac's upsampler does, from a frame instead of latents.
class FrameModel : public Network {
 public:
  /// Throws as FrameSettings::check.
  FrameModel(const FrameSettings& settings, Rng& rng);
  /// Throws std::invalid_argument on another shape.
  Variable forward(const Variable& frames) const;
  Drawing draw(const Variable& frames) const override;
  const FrameSettings& settings() const { return settings_; }
  NetworkFormat format() const override;
  Shape input_shape(Dim count) const override {
    return {count, settings_.height, settings_.width, settings_.in_channels};
  }

 private:
  FrameSettings settings_;
  Conv2d in_;
  std::vector<Rirb> rirbs_;
  Conv2d out_;
};

}  // namespace supertac
