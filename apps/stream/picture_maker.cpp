#include "apps/stream/picture_maker.h"

#include <cmath>
#include <stdexcept>

#include "data/samples/signal_features.h"
#include "io/numbers.h"
#include "models/interval.h"

namespace supertac {
namespace {

LiveWindowSettings window_settings(const ModelFile& model, const SensorSource& source) {
  if (source.array() != model.array()) {
    throw std::runtime_error("the signals are those of " + source.array().text() +
                             ", the model was trained on " + model.array().text() +
                             "; choose signals and model of one array (supertac-info tells)");
  }
  const double filter_s = source.filter_s();
  const double trained_s = model.input.filter_s.value_or(filter_s);
  const bool same = std::abs(trained_s - filter_s) < 1e-4;
  if (!same && filter_s > 0) {
    throw std::runtime_error("the signals have gone through a moving average of " + format(filter_s) +
                             " s, the model was trained behind one of " + format(trained_s) +
                             " s; choose signals and model of one kind (supertac-info tells)");
  }
  return {.timesteps = static_cast<int>(model.model->settings().timesteps),
          .signals = model.array().signals(),
          .rate_hz = model.input.rate_hz,
          .scaling = model.input.scaling,
          .filter_s = same ? 0 : trained_s,
          .frame_period_s = source.period_s()};
}

}  // namespace

PictureMaker::PictureMaker(std::span<const ModelFile> models, const SensorSource& source)
    : model_(models.front()),
      network_(models),
      window_(window_settings(model_, source)),
      input_(network_.first().input_shape(1)),
      output_(network_.estimate(input_)) {  // the first run takes memory and chooses kernels
  features_.resize(signal_feature_count(model_.array()));
  for (const float value : output_.picture.values()) {
    if (!std::isfinite(value))
      throw std::runtime_error(
          "the model draws no numbers (NaN or infinity): its weights are damaged or its "
          "training diverged; choose another model");
  }
}

std::span<const float> PictureMaker::picture() {
  if (!window_.window(input_.values())) return {};
  output_ = network_.estimate(input_);
  return output_.picture.values();
}

double PictureMaker::doubt() const {
  double sum = 0;
  for (const float spread : output_.spread.values()) sum += static_cast<double>(at_least(spread));
  return output_.spread.defined()
             ? model_.interval_factor() * sum / static_cast<double>(output_.spread.size())
             : 0;
}

bool PictureMaker::unlike_training() {
  if (!model_.novelty) return false;
  signal_features(input_.values(), model_.array(), features_);
  return model_.novelty->unlike_training(features_);
}

double PictureMaker::window_s() const {
  return static_cast<double>(model_.model->settings().timesteps) / model_.input.rate_hz;
}

}  // namespace supertac
