#pragma once

#include <span>
#include <vector>

#include "apps/stream/sensor_source.h"
#include "data/samples/live_window.h"
#include "models/committee.h"

namespace supertac {

/// Frames in, pictures out: the signal path the model was trained behind, then the model. Used by one thread.
class PictureMaker {
 public:
  /// For the frames of this source. `models`, those of a committee, must outlive this. Throws
  /// std::runtime_error when they were trained on another array, or behind another moving average than the
  /// frames have gone through, which cannot be taken back.
  PictureMaker(std::span<const ModelFile> models, const SensorSource& source);

  void push(const SensorFrame& frame) { window_.push(frame.time_s, frame.volts); }
  /// The picture [height][width] of image() after the newest frame, valid until the next call; empty before
  /// window_s() without a gap.
  std::span<const float> picture();
  /// Of the newest picture: half the width of its pixels' 90 % intervals, mean over the pixels; 0 when the
  /// model does not say.
  double doubt() const;
  /// Whether the window that it was drawn from is unlike those of training.
  bool unlike_training();

  ImageGrid image() const { return model_.windows().array->picture(model_.windows().scale); }
  /// Seconds of signal that a picture needs.
  double window_s() const;
  const LiveWindow& window() const { return window_; }

 private:
  const ModelFile& model_;  // what all have in common
  Committee network_;
  LiveWindow window_;
  Tensor input_;
  Estimate output_;
  std::vector<float> features_;
};

}  // namespace supertac
