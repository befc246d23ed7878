#include "models/trainer.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "autograd/ops/arithmetic.h"
#include "data/samples/split.h"
#include "io/json.h"
#include "io/numbers.h"
#include "models/diagnosis.h"
#include "models/evaluation.h"

namespace supertac {
namespace {

// Streams of random numbers that must not meet: the seed is shared with splits and batching.
constexpr std::uint64_t kEpsStream = 0x65707300;
constexpr Dim kMostLanes = 4;

TrainingSettings checked(const TrainingSettings& settings) {
  settings.check();
  return settings;
}

SuperTac make_model(const TrainingSettings& settings) {
  Rng rng(settings.seed);
  return SuperTac(settings.model, rng);
}

}  // namespace

void TrainingSettings::check() const {
  model.check();
  loss.check();
  supertac::check(augment,
                  {.rows = static_cast<int>(model.rows), .columns = static_cast<int>(model.columns)});
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
  nlohmann::ordered_json json = {{"epochs", epochs},
                                 {"batch", batch},
                                 {"seed", seed},
                                 {"learning_rate", learning_rate},
                                 {"warm_up", warm_up},
                                 {"clip_norm", clip_norm},
                                 {"a", loss.a},
                                 {"beta", loss.beta},
                                 {"lambda", loss.lambda},
                                 {"lift", augment.lift},
                                 {"gain", augment.gain},
                                 {"taxel_gain", augment.taxel_gain},
                                 {"offset", augment.offset},
                                 {"noise", augment.noise},
                                 {"dropped", augment.dropped}};
  if (!sampling) json["sampling"] = false;  // not named otherwise: the text of older files stays the same
  return json.dump();
}

Trainer::Trainer(const WindowSet& windows, std::vector<std::uint32_t> train, const TrainingSettings& settings)
    : data_(windows),
      settings_(checked(settings)),
      batching_(std::move(train), static_cast<std::size_t>(settings.batch), settings.seed),
      model_(make_model(settings)),
      state_(model_.parameters(), {settings.learning_rate, settings.warm_up, settings.clip_norm},
             settings.epochs * steps_per_epoch()) {
  const SuperTacSettings& m = settings_.model;
  if (!fits(windows, m)) {
    throw std::invalid_argument("Trainer: the windows have " + std::to_string(windows.timesteps()) +
                                " samples of " + windows.array().text() + " and pictures of " +
                                windows.image().text() + ", the model expects " +
                                std::to_string(m.timesteps) + " samples of " + std::to_string(m.rows) + "x" +
                                std::to_string(m.columns) + " taxels with " + std::to_string(m.in_channels) +
                                " channel(s) and pictures of " + std::to_string(m.image_height()) + "x" +
                                std::to_string(m.image_width()));
  }
  indices_.resize(batching_.batch_size());
  const Dim n = static_cast<Dim>(indices_.size()), lanes = std::min(kMostLanes, n);
  for (Dim i = 0; i < lanes; ++i)
    lanes_.emplace_back(model_, i * n / lanes, (i + 1) * n / lanes - i * n / lanes);
  for (const Lane& lane : lanes_) lane_parameters_.push_back(&lane.model.parameters());
  pictures_ = lanes_[0].pictures, truths_ = lanes_[0].truths, means_ = lanes_[0].means;
}

Trainer::Lane::Lane(const SuperTac& master, Dim first_sample, Dim count)
    : first(first_sample), model([&] {
        Rng rng(0);
        return SuperTac(master.settings(), rng);
      }()) {
  const SuperTacSettings& s = master.settings();
  windows = Tensor(Shape{count, s.timesteps, s.signals()});
  truth = Tensor(Shape{count, s.image_height(), s.image_width(), 1});
  for (Dim g = 0; g < s.groups(); ++g) eps.push_back(Tensor::zeros(Shape{count, s.latent}));
  pictures = truths = Spread(static_cast<std::size_t>(s.image_height() * s.image_width()));
  means = Spread(static_cast<std::size_t>(s.groups() * s.latent));
  share_values(master.parameters(), model.parameters());
}

void Trainer::fill(Lane& lane) const {
  const auto per_epoch = static_cast<std::uint64_t>(steps_per_epoch());
  const std::uint64_t epoch = static_cast<std::uint64_t>(step()) / per_epoch;
  const std::uint64_t b = static_cast<std::uint64_t>(step()) % per_epoch;
  const auto count = static_cast<std::size_t>(lane.windows.dim(0));
  const std::size_t window_size = lane.windows.values().size() / count;
  const std::size_t truth_size = lane.truth.values().size() / count;
  for (std::size_t n = 0; n < count; ++n) {
    const std::size_t slot = static_cast<std::size_t>(lane.first) + n;
    const std::span<float> window = lane.windows.values().subspan(n * window_size, window_size);
    data_.window(indices_[slot], window);
    if (settings_.augment.any()) {
      augment(settings_.augment, settings_.seed, batching_.sample(epoch, b, slot), window, data_.array());
    }
    data_.truth(indices_[slot], lane.truth.values().subspan(n * truth_size, truth_size));
  }
}

// The numbers of sample i of step s do not depend on how the batch is cut.
void Trainer::draw_eps(Lane& lane) const {
  if (!settings_.sampling) return;  // eps stays 0
  const RandomStream random(settings_.seed, kEpsStream);
  const auto latent = static_cast<std::uint64_t>(settings_.model.latent);
  const std::size_t groups = lane.eps.size();
  for (std::size_t g = 0; g < groups; ++g) {
    real* eps = lane.eps[g].data();
    for (Dim n = 0; n < lane.eps[g].dim(0); ++n) {
      const std::uint64_t sample =
          static_cast<std::uint64_t>(step()) * indices_.size() + static_cast<std::uint64_t>(lane.first + n);
      for (std::uint64_t i = 0; i < latent; ++i) {
        *eps++ = static_cast<real>(random.normal((sample * groups + g) * latent + i));
      }
    }
  }
}

// Forward, loss, backward of one lane, each term weighted by its share of the batch.
void Trainer::run_lane(Lane& lane) const {
  fill(lane);
  draw_eps(lane);
  clear_gradients(lane.model.parameters());
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
  for (std::size_t g = 0; g < lane.eps.size(); ++g) {
    lane.means.add(output.latent[g].mean.value(), g * static_cast<std::size_t>(settings_.model.latent));
  }
  if (std::isfinite(lane.terms.total)) return backward(scale(loss.total, static_cast<real>(share)));
  lane.trouble = where_not_finite(loss.total, lane.model.parameters());
}

StepReport Trainer::train_step() {
  if (done())
    throw std::invalid_argument("train_step: all " + std::to_string(total_steps()) + " steps are done");
  const auto per_epoch = static_cast<std::uint64_t>(steps_per_epoch());
  batching_.batch(static_cast<std::uint64_t>(step()) / per_epoch,
                  static_cast<std::uint64_t>(step()) % per_epoch, indices_);
#pragma omp parallel for schedule(static, 1)
  for (std::size_t i = 0; i < lanes_.size(); ++i) {
    try {
      run_lane(lanes_[i]);
    } catch (...) {  // an exception must not leave a thread
      lanes_[i].error = std::current_exception();
    }
  }
  StepReport report{.step = step() + 1, .learning_rate = state_.learning_rate()};
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
  report.gradient_norm = state_.apply(lane_parameters_);
  return report;
}

void Trainer::check_finite(const StepReport& r) const {
  if (std::isfinite(r.total)) return;
  std::string where;
  for (const Lane& lane : lanes_) {
    if (where.empty()) where = lane.trouble;
  }
  state_.stop("the loss is " + format(r.total) + " (reconstruction " + format(r.reconstruction) + ", KLD " +
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
  const bool now = report.active_latents == 0 || senseless(pictures_, truths_, samples);
  report.collapsed = state_.collapsed(now);
}

// What a saved state must agree in, besides the caller's own metadata.
std::map<std::string, std::string> Trainer::full(std::map<std::string, std::string> metadata) const {
  metadata.merge(model_metadata(settings_.model, input_of(data_)));
  metadata["training"] = settings_.text();
  return metadata;
}

void Trainer::save(const std::string& path, std::map<std::string, std::string> metadata) const {
  state_.save(path, full(std::move(metadata)));
}

void Trainer::restore(const std::string& path, const std::map<std::string, std::string>& expected_metadata) {
  state_.restore(path, full(expected_metadata));
}

}  // namespace supertac
