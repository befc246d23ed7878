#include "models/trainer.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "autograd/kernels/elementwise.h"
#include "autograd/ops/arithmetic.h"
#include "data/split.h"
#include "io/json.h"
#include "io/numbers.h"
#include "models/diagnosis.h"

namespace supertac {
namespace {

// Streams of random numbers that must not meet: the seed is shared with splits and batching.
constexpr std::uint64_t kEpsStream = 0x65707300;
constexpr Dim kMostLanes = 4;
constexpr int kFlatStepsToReport = 100;

TrainingSettings checked(const TrainingSettings& settings) {
  settings.check();
  return settings;
}

SuperTac make_model(const TrainingSettings& settings) {
  Rng rng(settings.seed);
  return SuperTac(settings.model, rng);
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
  pictures_ = lanes_[0].pictures, truths_ = lanes_[0].truths, means_ = lanes_[0].means;
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
  pictures = truths = Spread(static_cast<std::size_t>(s.image_size() * s.image_size()));
  means = Spread(kGroups * static_cast<std::size_t>(s.latent));
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
  lane.terms = {.total = share * loss.total.item(),
                .reconstruction = share * loss.reconstruction.item(),
                .kld = share * loss.kld.item(),
                .l2 = share * loss.l2.item(),
                .ssim = share * loss.ssim.item()};
  for (Spread* spread : {&lane.pictures, &lane.truths, &lane.means}) spread->clear();
  lane.pictures.add(output.image.value());
  lane.truths.add(lane.truth);
  for (std::size_t g = 0; g < kGroups; ++g) {
    lane.means.add(output.latent[g].mean.value(), g * static_cast<std::size_t>(settings_.model.latent));
  }
  if (std::isfinite(lane.terms.total)) return backward(scale(loss.total, static_cast<real>(share)));
  lane.trouble = where_not_finite(loss.total, lane.model.parameters());
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
  look_for_collapse(report);
  add_gradients();
  adam_.set_learning_rate(report.learning_rate);
  report.gradient_norm = adam_.step();
  if (!std::isfinite(report.gradient_norm)) {
    const std::string name = gradient_not_finite(model_.parameters());
    stop(name.empty() ? "the gradient's norm overflows" : "the gradient of " + name + " is not finite");
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
  std::string where;
  for (const Lane& lane : lanes_) {
    if (where.empty()) where = lane.trouble;
  }
  stop("the loss is " + format(r.total) + " (reconstruction " + format(r.reconstruction) + ", KLD " +
       format(r.kld) + ", L2 " + format(r.l2) + ", SSIM " + format(r.ssim) + ")" +
       (where.empty() ? "" : ": " + where));
}

void Trainer::look_for_collapse(StepReport& report) {
  for (Spread* spread : {&pictures_, &truths_, &means_}) spread->clear();
  for (const Lane& lane : lanes_) {
    pictures_.add(lane.pictures);
    truths_.add(lane.truths);
    means_.add(lane.means);
  }
  if (indices_.size() < 2) return;  // nothing to compare with
  const auto samples = static_cast<double>(indices_.size());
  report.active_latents = active_latents(means_, samples);
  const bool now = report.active_latents == 0 || same_for_all(pictures_, truths_, samples);
  // While the rate still rises a network has not had its chance to learn.
  flat_steps_ = now && step_ >= schedule_.warm_up ? flat_steps_ + 1 : 0;
  report.collapsed = flat_steps_ >= kFlatStepsToReport;
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
