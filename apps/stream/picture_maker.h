#pragma once

#include <span>

#include "apps/stream/sensor_source.h"
#include "data/live_window.h"
#include "models/model_file.h"

namespace supertac {

/// Frames in, pictures out: the signal path the model was trained behind, then the model. Used by one thread.
class PictureMaker {
 public:
  /// For frames `period_s` apart that have gone through a moving average of `filter_s` already. `model` must
  /// outlive this. @throws std::runtime_error when the model was trained behind another average, which cannot
  /// be taken back.
  PictureMaker(const ModelFile& model, double period_s, double filter_s);

  void push(const SensorFrame& frame) { window_.push(frame.time_s, frame.volts); }
  /// The picture [S][S] after the newest frame, valid until the next call; empty before window_s() without a
  /// gap.
  std::span<const float> picture();

  size_t image_size() const { return static_cast<size_t>(model_.model->settings().image_size()); }
  /// Seconds of signal that a picture needs.
  double window_s() const;
  const LiveWindow& window() const { return window_; }

 private:
  const ModelFile& model_;
  LiveWindow window_;
  Tensor input_, output_;
};

}  // namespace supertac
