#include "models/trainer.h"

#include <cmath>

#include "autograd/kernels/elementwise.h"
#include "data/split.h"
#include "io/json.h"
#include "io/numbers.h"

namespace supertac {
namespace {

// Streams of random numbers that must not meet: the seed is shared with splits and batching.
constexpr std::uint64_t kEpsStream = 0x65707300;
constexpr int kFlatStepsToReport = 100;
constexpr double kFlatShare = 0.02;  // of the truth's standard deviation

TrainingSettings checked(const TrainingSettings& settings) {
  settings.check();
  return settings;
}

SuperTac make_model(const TrainingSettings& settings) {
  Rng rng(settings.seed);
  return SuperTac(settings.model, rng);
}

double standard_deviation(const Tensor& t) {
  const double n = static_cast<double>(t.size());
  const double mean = kernels::sum(t.size(), t.data()) / n;
  return std::sqrt(std::max(0.0, kernels::sum_of_squares(t.size(), t.data()) / n - mean * mean));
}

void copy_into(Tensor& to, const Tensor& from) { std::copy_n(from.data(), from.size(), to.data()); }

}  // namespace

void TrainingSettings::check() const {
  model.check();
  loss.check();
  supertac::check(augment);
  const auto require = [](bool holds, const char* what) {
    if (!holds) throw std::invalid_argument(std::string("training settings: ") + what);
  };
  require(epochs >= 1 && epochs <= 100'000, "epochs must be 1 to 100000");
  require(batch >= 1 && batch <= 4096, "batch must be 1 to 4096");
  require(learning_rate > 0 && learning_rate <= 1, "learning rate must be above 0 and at most 1");
  require(warm_up >= 0 && warm_up < 1, "warm-up must be a share of all steps, 0 to below 1");
  require(clip_norm >= 0 && std::isfinite(clip_norm), "clip norm must not be negative (0 = never)");
}

std::string TrainingSettings::text() const {
  const nlohmann::ordered_json json = {{"epochs", epochs},
                                       {"batch", batch},
                                       {"seed", seed},
                                       {"learning_rate", learning_rate},
                                       {"warm_up", warm_up},
                                       {"clip_norm", clip_norm},
                                       {"a", loss.a},
                                       {"beta", loss.beta},
                                       {"lambda", loss.lambda},
                                       {"gain", augment.gain},
                                       {"taxel_gain", augment.taxel_gain},
                                       {"offset", augment.offset},
                                       {"noise", augment.noise},
                                       {"dropped", augment.dropped}};
  return json.dump();
}

Trainer::Trainer(const WindowSet& windows, std::vector<std::uint32_t> train, const TrainingSettings& settings)
    : data_(windows),
      settings_(checked(settings)),
      batching_(std::move(train), static_cast<std::size_t>(settings.batch), settings.seed),
      model_(make_model(settings)),
      adam_(values_of(model_.parameters()),
            {.learning_rate = settings.learning_rate, .clip_norm = settings.clip_norm}) {
  if (windows.timesteps() != settings.model.timesteps ||
      windows.image_size() != settings.model.image_size()) {
    throw std::invalid_argument(
        "Trainer: the windows have " + std::to_string(windows.timesteps()) + " samples and " +
        std::to_string(windows.image_size()) + " pixels a side, the model expects " +
        std::to_string(settings.model.timesteps) + " and " + std::to_string(settings.model.image_size()));
  }
  total_steps_ = settings.epochs * steps_per_epoch();
  schedule_ = {.peak = settings.learning_rate,
               .warm_up = static_cast<std::int64_t>(settings.warm_up * static_cast<double>(total_steps_)),
               .total = total_steps_};
  indices_.resize(batching_.batch_size());
  const Dim n = static_cast<Dim>(indices_.size()), size = settings.model.image_size();
  windows_ = Tensor(Shape{n, settings.model.timesteps, kWindowTaxels});
  truth_ = Tensor(Shape{n, size, size, 1});
  for (Tensor& eps : eps_) eps = Tensor(Shape{n, settings.model.latent});
}

void Trainer::fill_batch() {
  const auto per_epoch = static_cast<std::uint64_t>(steps_per_epoch());
  const std::uint64_t epoch = static_cast<std::uint64_t>(step_) / per_epoch,
                      b = static_cast<std::uint64_t>(step_) % per_epoch;
  batching_.batch(epoch, b, indices_);
  const std::size_t window_size = static_cast<std::size_t>(windows_.size()) / indices_.size();
  const std::size_t truth_size = static_cast<std::size_t>(truth_.size()) / indices_.size();
  const auto count = static_cast<std::int64_t>(indices_.size());
#pragma omp parallel for schedule(static) if (count > 8)
  for (std::int64_t n = 0; n < count; ++n) {
    const auto i = static_cast<std::size_t>(n);
    const std::span<float> window = windows_.values().subspan(i * window_size, window_size);
    data_.window(indices_[i], window);
    if (settings_.augment.any())
      augment(settings_.augment, settings_.seed, batching_.sample(epoch, b, i), window);
    data_.truth(indices_[i], truth_.values().subspan(i * truth_size, truth_size));
  }
}

void Trainer::draw_eps() {
  const RandomStream random(settings_.seed, kEpsStream);
  auto counter = static_cast<std::uint64_t>(step_) * kGroups * static_cast<std::uint64_t>(eps_[0].size());
  for (Tensor& eps : eps_) {
    for (real& e : eps.values()) e = static_cast<real>(random.normal(counter++));
  }
}

StepReport Trainer::train_step() {
  if (done())
    throw std::invalid_argument("train_step: all " + std::to_string(total_steps_) + " steps are done");
  fill_batch();
  draw_eps();
  const SuperTac::Output output = model_.forward(windows_, eps_);
  const Loss loss = supertac_loss(output, truth_, settings_.loss);
  StepReport report{.step = step_ + 1,
                    .total = loss.total.item(),
                    .reconstruction = loss.reconstruction.item(),
                    .kld = loss.kld.item(),
                    .l2 = loss.l2.item(),
                    .ssim = loss.ssim.item(),
                    .learning_rate = schedule_.at(step_)};
  if (!std::isfinite(report.total)) {
    stop("the loss is " + format(report.total) + " (reconstruction " + format(report.reconstruction) +
         ", KLD " + format(report.kld) + ", L2 " + format(report.l2) + ", SSIM " + format(report.ssim) + ")");
  }
  report.collapsed = collapsed(output.image.value());
  adam_.zero_grad();
  backward(loss.total);
  adam_.set_learning_rate(report.learning_rate);
  report.gradient_norm = adam_.step();
  if (!std::isfinite(report.gradient_norm)) {
    for (const Parameter& p : model_.parameters()) {
      const Tensor& gradient = p.value.grad();
      if (!std::isfinite(kernels::sum_of_squares(gradient.size(), gradient.data()))) {
        stop("the gradient of " + p.name + " is not finite");
      }
    }
    stop("the gradient's norm is not finite");
  }
  ++step_;
  return report;
}

bool Trainer::collapsed(const Tensor& pictures) {
  const bool flat = standard_deviation(pictures) < kFlatShare * standard_deviation(truth_);
  flat_steps_ = flat ? flat_steps_ + 1 : 0;
  return flat_steps_ >= kFlatStepsToReport;
}

void Trainer::stop(const std::string& what) const {
  throw TrainingStopped("training stopped at step " + std::to_string(step_ + 1) + ": " + what +
                        "; lower --learning-rate (now " + format(settings_.learning_rate) +
                        ") or check the input with supertac-info");
}

void Trainer::save(const std::string& path, std::map<std::string, std::string> metadata) const {
  std::vector<StoredTensor> state;
  const std::vector<Parameter>& parameters = model_.parameters();
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    state.push_back(to_stored(parameters[i], adam_.first_moments()[i], "optimizer.m." + parameters[i].name));
    state.push_back(to_stored(parameters[i], adam_.second_moments()[i], "optimizer.v." + parameters[i].name));
  }
  metadata.merge(model_metadata(settings_.model, {data_.settings().rate_hz, data_.settings().scaling}));
  metadata["training"] = settings_.text();
  metadata["step"] = std::to_string(step_);
  metadata["flat_steps"] = std::to_string(flat_steps_);
  write_checkpoint(path, parameters, std::move(metadata), state);
}

void Trainer::restore(const std::string& path, const std::map<std::string, std::string>& expected_metadata) {
  const SafetensorsFile file = read_checkpoint(path);
  auto expected = expected_metadata;
  expected.merge(model_metadata(settings_.model, {data_.settings().rate_hz, data_.settings().scaling}));
  expected["training"] = settings_.text();
  for (const auto& [key, value] : expected) {
    const auto found = file.metadata().find(key);
    if (found != file.metadata().end() && found->second == value) continue;
    throw std::runtime_error(path + ": cannot resume: its " + key + " is " +
                             (found == file.metadata().end() ? "missing" : found->second) +
                             ", this run's is " + value +
                             "; give the same options and data, or start anew without --resume");
  }
  const auto integer = [&](const char* key) {
    const auto found = file.metadata().find(key);
    const auto value = found == file.metadata().end() ? std::nullopt : parse_int(found->second);
    if (!value || *value < 0 || *value > total_steps_) {
      throw std::runtime_error(path + ": holds no training state (metadata \"" + key +
                               "\"); resume from the last.safetensors of the run's folder");
    }
    return *value;
  };
  const std::int64_t step = integer("step"), flat_steps = integer("flat_steps");
  const std::vector<Parameter>& parameters = model_.parameters();
  std::vector<Tensor> m, v;
  for (const Parameter& p : parameters) {
    m.push_back(load_like(file, path, "optimizer.m." + p.name, p));
    v.push_back(load_like(file, path, "optimizer.v." + p.name, p));
  }
  load_parameters(file, path, parameters);
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    copy_into(adam_.first_moments()[i], m[i]);
    copy_into(adam_.second_moments()[i], v[i]);
  }
  adam_.set_steps(step);
  step_ = step;
  flat_steps_ = static_cast<int>(flat_steps);
}

}  // namespace supertac
