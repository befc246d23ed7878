// A stream's frames become pictures here.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "apps/stream/live_frame.h"
#include "apps/stream/sensor_source.h"
#include "data/windows/live_window.h"
#include "models/files/model_file.h"

namespace supertac {

/// Frames in, pictures out: the signal path the model was trained behind, then the model. Used by one thread.
class PictureMaker {
 public:
  /// For the frames of this source, which may speak another unit or polarity than the model's recordings.
  /// The `models` are averaged and must outlive this. Throws std::runtime_error when they were trained on
  /// another array, or behind another moving average than the frames have gone through, which cannot be taken
  /// back.
  PictureMaker(std::span<const ModelFile> models, const SensorSource& source,
               Precision precision = Precision::fp32);

  void push(const SensorFrame& frame);
  /// The picture [height][width] of image() after the newest frame, valid until the next call; empty before
  /// window_s() without a gap.
  std::span<const float> picture();
  /// Of the newest picture: half the width of each pixel's 90 % interval; empty when the model does not say.
  std::span<const float> half_widths() const { return half_widths_; }
  /// Its predicted errors; likewise.
  std::span<const float> predicted_errors() const {
    return output_.predicted_error.defined() ? output_.predicted_error.values() : std::span<const float>();
  }
  const PixelInterval& interval() const { return interval_; }
  /// How far the window that it was drawn from is from those of training (models/inference/novelty.h);
  /// nothing when the model does not say.
  std::optional<double> distance() const { return distance_; }
  bool unlike_training() const { return distance_ && *distance_ > model_.novelty->limit(); }

  /// Takes these signals, in the source's unit, for "nothing": each is moved so that it rests where it rested
  /// in training, from the next frame on.
  void rezero(std::span<const double> resting);
  /// The newest frame as the model takes it: moved by rezero().
  std::span<const float> signals() const { return signals_; }

  PictureFormat format() const;
  ImageGrid image() const { return model_.windows().array->picture(model_.windows().scale); }
  /// How long ago the finger was where a picture shows it.
  double delay_s() const { return model_.input.delay_s; }
  /// Seconds of signal that a picture needs.
  double window_s() const;
  const LiveWindow& window() const { return window_; }

 private:
  const ModelFile& model_;  // what all have in common
  Ensemble network_;
  LiveWindow window_;
  Tensor input_;
  Estimate output_;
  std::vector<float> features_;
  SignalScale source_scale_;
  PixelInterval interval_;
  std::vector<float> half_widths_;
  std::optional<double> distance_;
  std::vector<float> signals_, move_;  // of the newest frame; what rezero() adds
};

}  // namespace supertac
