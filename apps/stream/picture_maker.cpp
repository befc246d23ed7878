#include "apps/stream/picture_maker.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "io/numbers/numbers.h"
#include "models/inference/interval.h"
#include "models/inference/novelty.h"

namespace supertac {
namespace {

LiveWindowSettings window_settings(const ModelFile& model, const SensorSource& source) {
  if (source.array() != model.array()) {
    throw std::runtime_error("the signals are those of " + source.array().text() +
                             ", the model was trained on " + model.array().text() +
                             "; choose signals and model of one array (supertac-info tells)");
  }
  const std::optional<double> filter_s = model.input.filter_left(source.filter_s());
  if (!filter_s) {
    throw std::runtime_error("the signals have gone through a moving average of " +
                             format(source.filter_s()) + " s, the model was trained behind one of " +
                             format(*model.input.filter_s) +
                             " s; choose signals and model of one kind (supertac-info tells)");
  }
  return {.timesteps = static_cast<int>(model.model->settings().timesteps),
          .signals = model.array().signals(),
          .rate_hz = model.input.rate_hz,
          .scaling = model.input.scaling,
          .filter_s = *filter_s,
          .frame_period_s = source.period_s()};
}

}  // namespace

PictureMaker::PictureMaker(std::span<const ModelFile> models, const SensorSource& source, Precision precision)
    : model_(models.front()),
      network_(ensemble_of(models, precision)),
      window_(window_settings(model_, source)),
      input_(network_.first().input_shape(1)),
      output_(network_.estimate(input_)),  // the first run takes memory and chooses kernels
      source_scale_(source.signal_scale()),
      interval_(model_.interval()) {
  features_.resize(signal_feature_count(model_.array(), input_.values().size() / model_.array().signals()));
  for (const float value : output_.picture.values()) {
    if (!std::isfinite(value))
      throw std::runtime_error(
          "the model draws no numbers (NaN or infinity): its weights are damaged or its "
          "training diverged; choose another model");
  }
}

void PictureMaker::push(const SensorFrame& frame) {
  move_.resize(frame.signals.size());
  signals_.assign(frame.signals.begin(), frame.signals.end());
  if (const SignalScale& own = model_.input.signal_scale; source_scale_ != own)
    for (float& value : signals_) value = static_cast<float>(source_scale_.in(own, double{value}));
  for (std::size_t s = 0; s < signals_.size(); ++s) signals_[s] += move_[s];
  window_.push(frame.time_s, signals_);
}

void PictureMaker::rezero(std::span<const double> resting) {
  const Scaling& scaling = model_.input.scaling;
  // A rig at rest lies a little below what its scaling calls 0.
  const double rest = scaling.rest == Scaling{}.rest ? rig::kRestVolts : scaling.rest;
  move_.clear();
  for (const double value : resting)
    move_.push_back(static_cast<float>(rest - source_scale_.in(model_.input.signal_scale, value)));
}

std::span<const float> PictureMaker::picture() {
  if (!window_.window(input_.values())) return {};
  output_ = network_.estimate(input_);
  if (output_.predicted_error.defined()) {
    interval_.with_load(network_.first().format(), input_.values(), output_.predicted_error.values(),
                        half_widths_);
    interval_.half_widths(output_.picture.values(), image().width, half_widths_, half_widths_);
  }
  if (model_.novelty) {
    signal_features(input_.values(), model_.array(), features_);
    distance_ = model_.novelty->distance(features_);
  }
  return output_.picture.values();
}

PictureFormat PictureMaker::format() const {
  return {model_.array().signals(), image(), output_.predicted_error.defined(), model_.novelty.has_value()};
}

double PictureMaker::window_s() const {
  return static_cast<double>(model_.model->settings().timesteps) / model_.input.rate_hz;
}

}  // namespace supertac
