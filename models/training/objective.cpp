#include "models/training/objective.h"

#include <algorithm>
#include <stdexcept>

#include "io/files/json.h"

namespace supertac {
namespace {

nlohmann::ordered_json pace_json(const TrainingPace& p) {
  nlohmann::ordered_json json{{"epochs", p.epochs},   {"batch", p.batch},
                              {"seed", p.seed},       {"learning_rate", p.learning_rate},
                              {"warm_up", p.warm_up}, {"clip_norm", p.clip_norm}};
  if (p.muon) json["optimizer"] = "muon";  // not named otherwise: the text of older files stays the same
  return json;
}

template <class Model, class Settings>
Model make_model(const Settings& settings, std::uint64_t seed) {
  Rng rng(seed);
  return Model(settings, rng);
}

class WindowObjective : public Objective {
 public:
  WindowObjective(const TrainingSettings& settings, const InputSettings& input, const TaxelArray& array,
                  std::uint64_t seed)
      : settings_(settings),
        input_(input),
        array_(array),
        model_(make_model<SuperTac>(settings.model, seed)) {}

  const Network& network() const override { return model_; }
  const TrainingPace& pace() const override { return settings_; }
  std::unique_ptr<Objective> clone() const override {
    return std::make_unique<WindowObjective>(settings_, input_, array_, 0);
  }

  BatchOutput operator()(const Batch& batch) const override {
    const SuperTac::Output drawn = model_.forward(batch.inputs, eps_of(batch).span());
    BatchOutput output{supertac_loss(drawn, batch.targets, settings_.loss), drawn.image,
                       PerGroup<Variable>(settings_.model.groups())};
    for (std::size_t g = 0; g < output.means.size(); ++g) output.means[g] = drawn.latent[g].mean;
    return output;
  }
  Dim noise() const override { return settings_.sampling ? latents() : 0; }
  Dim latents() const override { return settings_.model.groups() * settings_.model.latent; }
  void augment(std::uint64_t sample, std::span<float> input) const override {
    if (settings_.augment.any()) supertac::augment(settings_.augment, settings_.seed, sample, input, array_);
  }

  std::string text() const override { return to_json(settings_).dump(); }
  std::map<std::string, std::string> metadata() const override {
    return model_metadata(settings_.model, input_);
  }

 private:
  // A group's columns of the noise; zeros without sampling.
  PerGroup<Tensor> eps_of(const Batch& batch) const {
    const Dim samples = batch.inputs.dim(0), latent = settings_.model.latent;
    PerGroup<Tensor> eps(settings_.model.groups());
    for (std::size_t g = 0; g < eps.size(); ++g) {
      eps[g] = Tensor::zeros(Shape{samples, latent});
      for (Dim n = 0; settings_.sampling && n < samples; ++n) {
        const real* from = batch.noise.data() + n * latents() + static_cast<Dim>(g) * latent;
        std::copy_n(from, latent, eps[g].data() + n * latent);
      }
    }
    return eps;
  }

  TrainingSettings settings_;
  InputSettings input_;
  TaxelArray array_;
  SuperTac model_;
};

class FrameObjective : public Objective {
 public:
  FrameObjective(const FrameTrainingSettings& settings, const ChannelScaling& scaling, std::uint64_t seed)
      : settings_(settings), scaling_(scaling), model_(make_model<FrameModel>(settings.model, seed)) {}

  const Network& network() const override { return model_; }
  const TrainingPace& pace() const override { return settings_; }
  std::unique_ptr<Objective> clone() const override {
    return std::make_unique<FrameObjective>(settings_, scaling_, 0);
  }
  BatchOutput operator()(const Batch& batch) const override {
    const Variable picture = model_.forward(Variable(batch.inputs));
    return {picture_loss(picture, batch.targets, settings_.lambda), picture, PerGroup<Variable>()};
  }
  std::string text() const override { return to_json(settings_).dump(); }
  std::map<std::string, std::string> metadata() const override {
    return model_metadata(settings_.model, scaling_);
  }

 private:
  FrameTrainingSettings settings_;
  ChannelScaling scaling_;
  FrameModel model_;
};

}  // namespace

nlohmann::ordered_json to_json(const TrainingSettings& s) {
  nlohmann::ordered_json json = pace_json(s);
  json.update({{"a", s.loss.a},
               {"beta", s.loss.beta},
               {"lambda", s.loss.lambda},
               {"lift", s.augment.lift},
               {"gain", s.augment.gain},
               {"taxel_gain", s.augment.taxel_gain},
               {"offset", s.augment.offset},
               {"noise", s.augment.noise},
               {"dropped", s.augment.dropped}});
  if (!s.sampling) json["sampling"] = false;  // not named otherwise, as above
  return json;
}

nlohmann::ordered_json to_json(const FrameTrainingSettings& s) {
  nlohmann::ordered_json json = pace_json(s);
  json["lambda"] = s.lambda;
  return json;
}

void Objective::augment(std::uint64_t, std::span<float>) const {}

std::unique_ptr<Objective> window_objective(const WindowSet& windows, const TrainingSettings& settings) {
  settings.check();
  settings.loss.check();
  check(settings.augment, windows.array());
  return std::make_unique<WindowObjective>(settings, input_of(windows), windows.array(), settings.seed);
}

std::unique_ptr<Objective> frame_objective(const PairSet& pairs, FrameTrainingSettings settings) {
  settings.check();
  if (!(settings.lambda >= 0))
    throw std::invalid_argument("training settings: lambda must not be negative, got " +
                                std::to_string(settings.lambda));
  const TaxelArray array = pairs.array();
  settings.model.in_channels = array.channels;
  settings.model.height = array.rows;
  settings.model.width = array.columns;
  settings.model.scale = pairs.scale();
  return std::make_unique<FrameObjective>(settings, pairs.scaling(), settings.seed);
}

}  // namespace supertac
