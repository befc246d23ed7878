#include "models/trainer.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "autograd/kernels/elementwise.h"
#include "autograd/ops/arithmetic.h"
#include "data/split.h"
#include "io/json.h"
#include "io/numbers.h"

namespace supertac {
namespace {

// Streams of random numbers that must not meet: the seed is shared with splits and batching.
constexpr std::uint64_t kEpsStream = 0x65707300;
constexpr Dim kMostLanes = 4;
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

double standard_deviation(double sum, double squares, double n) {
  return std::sqrt(std::max(0.0, squares / n - sum / n * (sum / n)));
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
  const Dim n = static_cast<Dim>(indices_.size()), lanes = std::min(kMostLanes, n);
  for (Dim i = 0; i < lanes; ++i)
    lanes_.emplace_back(model_, i * n / lanes, (i + 1) * n / lanes - i * n / lanes);
}

Trainer::Lane::Lane(const SuperTac& master, Dim first_sample, Dim count)
    : first(first_sample), model([&] {
        Rng rng(0);
        return SuperTac(master.settings(), rng);
      }()) {
  const SuperTacSettings& s = master.settings();
  windows = Tensor(Shape{count, s.timesteps, kWindowTaxels});
  truth = Tensor(Shape{count, s.image_size(), s.image_size(), 1});
  for (Tensor& e : eps) e = Tensor(Shape{count, s.latent});
  for (std::size_t i = 0; i < master.parameters().size(); ++i) {
    Variable own = model.parameters()[i].value;
    own.mutable_value() = master.parameters()[i].value.value();  // the same buffer
    own.mutable_grad() = Tensor::zeros(own.shape());
  }
}

void Trainer::fill(Lane& lane) const {
  const auto per_epoch = static_cast<std::uint64_t>(steps_per_epoch());
  const std::uint64_t epoch = static_cast<std::uint64_t>(step_) / per_epoch;
  const std::uint64_t b = static_cast<std::uint64_t>(step_) % per_epoch;
  const auto count = static_cast<std::size_t>(lane.windows.dim(0));
  const std::size_t window_size = lane.windows.values().size() / count;
  const std::size_t truth_size = lane.truth.values().size() / count;
  for (std::size_t n = 0; n < count; ++n) {
    const std::size_t slot = static_cast<std::size_t>(lane.first) + n;
    const std::span<float> window = lane.windows.values().subspan(n * window_size, window_size);
    data_.window(indices_[slot], window);
    if (settings_.augment.any()) {
      augment(settings_.augment, settings_.seed, batching_.sample(epoch, b, slot), window);
    }
    data_.truth(indices_[slot], lane.truth.values().subspan(n * truth_size, truth_size));
  }
}

// The numbers of sample i of step s do not depend on how the batch is cut.
void Trainer::draw_eps(Lane& lane) const {
  const RandomStream random(settings_.seed, kEpsStream);
  const auto latent = static_cast<std::uint64_t>(settings_.model.latent);
  for (std::size_t g = 0; g < kGroups; ++g) {
    real* eps = lane.eps[g].data();
    for (Dim n = 0; n < lane.eps[g].dim(0); ++n) {
      const std::uint64_t sample =
          static_cast<std::uint64_t>(step_) * indices_.size() + static_cast<std::uint64_t>(lane.first + n);
      for (std::uint64_t i = 0; i < latent; ++i) {
        *eps++ = static_cast<real>(random.normal((sample * kGroups + g) * latent + i));
      }
    }
  }
}

// Forward, loss, backward of one lane, each term weighted by its share of the batch.
void Trainer::run_lane(Lane& lane) const {
  fill(lane);
  draw_eps(lane);
  for (const Parameter& p : lane.model.parameters()) Variable(p.value).mutable_grad().fill(0);
  const SuperTac::Output output = lane.model.forward(lane.windows, lane.eps);
  const Loss loss = supertac_loss(output, lane.truth, settings_.loss);
  const double share = static_cast<double>(lane.windows.dim(0)) / static_cast<double>(indices_.size());
  const Tensor& pictures = output.image.value();
  lane.terms = {.total = share * loss.total.item(),
                .reconstruction = share * loss.reconstruction.item(),
                .kld = share * loss.kld.item(),
                .l2 = share * loss.l2.item(),
                .ssim = share * loss.ssim.item()};
  lane.picture_sum = kernels::sum(pictures.size(), pictures.data());
  lane.picture_squares = kernels::sum_of_squares(pictures.size(), pictures.data());
  lane.truth_sum = kernels::sum(lane.truth.size(), lane.truth.data());
  lane.truth_squares = kernels::sum_of_squares(lane.truth.size(), lane.truth.data());
  if (std::isfinite(lane.terms.total)) backward(scale(loss.total, static_cast<real>(share)));
}

StepReport Trainer::train_step() {
  if (done())
    throw std::invalid_argument("train_step: all " + std::to_string(total_steps_) + " steps are done");
  const auto per_epoch = static_cast<std::uint64_t>(steps_per_epoch());
  batching_.batch(static_cast<std::uint64_t>(step_) / per_epoch,
                  static_cast<std::uint64_t>(step_) % per_epoch, indices_);
#pragma omp parallel for schedule(static, 1)
  for (std::size_t i = 0; i < lanes_.size(); ++i) {
    try {
      run_lane(lanes_[i]);
    } catch (...) {  // an exception must not leave a thread
      lanes_[i].error = std::current_exception();
    }
  }
  StepReport report{.step = step_ + 1, .learning_rate = schedule_.at(step_)};
  for (Lane& lane : lanes_) {
    if (lane.error) std::rethrow_exception(std::exchange(lane.error, nullptr));
    report.total += lane.terms.total;
    report.reconstruction += lane.terms.reconstruction;
    report.kld += lane.terms.kld;
    report.l2 += lane.terms.l2;
    report.ssim += lane.terms.ssim;
  }
  check_finite(report);
  report.collapsed = collapsed();
  add_gradients();
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

void Trainer::add_gradients() {
  adam_.zero_grad();
  const std::vector<Parameter>& parameters = model_.parameters();
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    Variable parameter = parameters[i].value;
    for (const Lane& lane : lanes_) {
      const Tensor& part = lane.model.parameters()[i].value.grad();
      kernels::add_scaled(part.size(), 1, part.data(), parameter.mutable_grad().data());
    }
  }
}

void Trainer::check_finite(const StepReport& r) const {
  if (std::isfinite(r.total)) return;
  stop("the loss is " + format(r.total) + " (reconstruction " + format(r.reconstruction) + ", KLD " +
       format(r.kld) + ", L2 " + format(r.l2) + ", SSIM " + format(r.ssim) + ")");
}

bool Trainer::collapsed() {
  double sum = 0, squares = 0, truth_sum = 0, truth_squares = 0, n = 0;
  for (const Lane& lane : lanes_) {
    sum += lane.picture_sum;
    squares += lane.picture_squares;
    truth_sum += lane.truth_sum;
    truth_squares += lane.truth_squares;
    n += static_cast<double>(lane.truth.size());
  }
  const bool flat =
      standard_deviation(sum, squares, n) < kFlatShare * standard_deviation(truth_sum, truth_squares, n);
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
  metadata.merge(model_metadata(settings_.model,
                                {data_.settings().rate_hz, data_.settings().scaling, data_.filter_s()}));
  metadata["training"] = settings_.text();
  metadata["step"] = std::to_string(step_);
  metadata["flat_steps"] = std::to_string(flat_steps_);
  write_checkpoint(path, parameters, std::move(metadata), state);
}

void Trainer::restore(const std::string& path, const std::map<std::string, std::string>& expected_metadata) {
  const SafetensorsFile file = read_checkpoint(path);
  auto expected = expected_metadata;
  expected.merge(model_metadata(settings_.model,
                                {data_.settings().rate_hz, data_.settings().scaling, data_.filter_s()}));
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
