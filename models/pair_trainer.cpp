#include "models/pair_trainer.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "autograd/ops/arithmetic.h"
#include "autograd/ops/losses.h"
#include "io/json.h"
#include "io/numbers.h"
#include "models/diagnosis.h"

namespace supertac {
namespace {

constexpr Dim kMostLanes = 4;
constexpr std::size_t kBatch = 64;

FrameSettings sizes_of(const PairSet& pairs) {
  FrameSettings s;
  s.in_channels = static_cast<Dim>(pairs.channels());
  s.height = static_cast<Dim>(pairs.height());
  s.width = static_cast<Dim>(pairs.width());
  s.scale = static_cast<Dim>(pairs.scale());
  return s;
}

void check_sizes(const FrameSettings& model, const PairSet& pairs) {
  const FrameSettings own = sizes_of(pairs);
  if (model.in_channels == own.in_channels && model.height == own.height && model.width == own.width &&
      model.scale == own.scale)
    return;
  const auto text = [](const FrameSettings& s) {
    return std::to_string(s.in_channels) + " channels of " + std::to_string(s.height) + " x " +
           std::to_string(s.width) + ", scale " + std::to_string(s.scale);
  };
  throw std::invalid_argument("the pairs have " + text(own) + ", the model expects " + text(model));
}

PairTrainingSettings checked(const PairTrainingSettings& s, const PairSet& pairs) {
  check_sizes(s.model, pairs);
  if (s.epochs < 1 || s.epochs > 100'000 || s.batch < 1 || s.batch > 4096 || !(s.lambda >= 0))
    throw std::invalid_argument(
        "pair training: expected epochs 1 to 100000, batch 1 to 4096, lambda not negative");
  return s;
}

FrameModel make_model(const FrameSettings& settings, std::uint64_t seed) {
  Rng rng(seed);
  return FrameModel(settings, rng);
}

Tensor frames_for(const FrameSettings& s, Dim count) {
  return Tensor(Shape{count, s.height, s.width, s.in_channels});
}

Tensor pictures_for(const FrameSettings& s, Dim count) {
  return Tensor(Shape{count, s.height * s.scale, s.width * s.scale, 1});
}

// Sample n of a tensor whose first axis counts samples.
std::span<float> sample(Tensor& tensor, std::size_t n) {
  const std::size_t size = tensor.values().size() / static_cast<std::size_t>(tensor.dim(0));
  return tensor.values().subspan(n * size, size);
}

}  // namespace

PairTrainingSettings PairTrainingSettings::of(const PairSet& pairs) {
  PairTrainingSettings settings;
  settings.model = sizes_of(pairs);
  return settings;
}

std::string PairTrainingSettings::text() const {
  const nlohmann::ordered_json json = {{"epochs", epochs},
                                       {"batch", batch},
                                       {"seed", seed},
                                       {"learning_rate", optimiser.learning_rate},
                                       {"warm_up", optimiser.warm_up},
                                       {"clip_norm", optimiser.clip_norm},
                                       {"lambda", lambda}};
  return json.dump();
}

PairTrainer::PairTrainer(const PairSet& pairs, std::vector<std::uint32_t> train,
                         const PairTrainingSettings& settings)
    : pairs_(pairs),
      settings_(checked(settings, pairs)),
      scaling_(fit_scaling(pairs, train)),
      batching_(std::move(train), static_cast<std::size_t>(settings.batch), settings.seed),
      model_(make_model(settings.model, settings.seed)),
      state_(model_.parameters(), settings.optimiser, settings.epochs * steps_per_epoch()) {
  indices_.resize(batching_.batch_size());
  const Dim n = static_cast<Dim>(indices_.size()), lanes = std::min(kMostLanes, n);
  for (Dim i = 0; i < lanes; ++i)
    lanes_.emplace_back(model_, i * n / lanes, (i + 1) * n / lanes - i * n / lanes);
  for (const Lane& lane : lanes_) lane_parameters_.push_back(&lane.model.parameters());
  pictures_ = lanes_[0].pictures, truths_ = lanes_[0].truths;
}

PairTrainer::Lane::Lane(const FrameModel& master, Dim first_sample, Dim count)
    : first(first_sample),
      model(make_model(master.settings(), 0)),
      frames(frames_for(master.settings(), count)),
      truth(pictures_for(master.settings(), count)) {
  pictures = truths = Spread(static_cast<std::size_t>(truth.size() / count));
  share_values(master.parameters(), model.parameters());
}

// Forward, loss, backward of one lane, each term weighted by its share of the batch.
void PairTrainer::run_lane(Lane& lane) const {
  for (std::size_t n = 0; n < static_cast<std::size_t>(lane.frames.dim(0)); ++n) {
    const std::uint32_t pair = indices_[static_cast<std::size_t>(lane.first) + n];
    pairs_.input(pair, scaling_, sample(lane.frames, n));
    pairs_.target(pair, sample(lane.truth, n));
  }
  clear_gradients(lane.model.parameters());
  const Variable image = lane.model.forward(lane.frames);
  const Variable l2 = l2_loss(image, Variable(lane.truth)), similarity = ssim(image, lane.truth);
  const Variable one_minus_ssim = add(Variable(Tensor::full({}, 1)), scale(similarity, -1));
  const Variable total = add(l2, scale(one_minus_ssim, static_cast<real>(settings_.lambda)));
  const double share = static_cast<double>(lane.frames.dim(0)) / static_cast<double>(indices_.size());
  lane.terms = {.total = share * total.item(), .l2 = share * l2.item(), .ssim = share * similarity.item()};
  for (Spread* spread : {&lane.pictures, &lane.truths}) spread->clear();
  lane.pictures.add(image.value());
  lane.truths.add(lane.truth);
  if (std::isfinite(lane.terms.total)) return backward(scale(total, static_cast<real>(share)));
  lane.trouble = where_not_finite(total, lane.model.parameters());
}

StepReport PairTrainer::train_step() {
  if (done()) throw std::invalid_argument("train_step: all steps are done");
  const auto per_epoch = static_cast<std::uint64_t>(steps_per_epoch());
  const auto now = static_cast<std::uint64_t>(step());
  batching_.batch(now / per_epoch, now % per_epoch, indices_);
#pragma omp parallel for schedule(static, 1)
  for (std::size_t i = 0; i < lanes_.size(); ++i) {
    try {
      run_lane(lanes_[i]);
    } catch (...) {  // an exception must not leave a thread
      lanes_[i].error = std::current_exception();
    }
  }
  StepReport report{.step = step() + 1, .learning_rate = state_.learning_rate()};
  std::string trouble;
  for (Lane& lane : lanes_) {
    if (lane.error) std::rethrow_exception(std::exchange(lane.error, nullptr));
    report.total += lane.terms.total;
    report.l2 += lane.terms.l2;
    report.ssim += lane.terms.ssim;
    if (trouble.empty()) trouble = std::exchange(lane.trouble, {});
  }
  if (!std::isfinite(report.total))
    state_.stop("the loss is " + format(report.total) + (trouble.empty() ? "" : ": " + trouble));
  report.collapsed = state_.collapsed(looks_collapsed());
  report.gradient_norm = state_.apply(lane_parameters_);
  return report;
}

bool PairTrainer::looks_collapsed() {
  for (Spread* spread : {&pictures_, &truths_}) spread->clear();
  for (const Lane& lane : lanes_) {
    pictures_.add(lane.pictures);
    truths_.add(lane.truths);
  }
  return indices_.size() > 1 && senseless(pictures_, truths_, static_cast<double>(indices_.size()));
}

std::map<std::string, std::string> PairTrainer::full(std::map<std::string, std::string> metadata) const {
  metadata.merge(frame_metadata(settings_.model, scaling_));
  metadata["training"] = settings_.text();
  return metadata;
}

void PairTrainer::save(const std::string& path, std::map<std::string, std::string> metadata) const {
  state_.save(path, full(std::move(metadata)));
}

void PairTrainer::restore(const std::string& path, const std::map<std::string, std::string>& expected) {
  state_.restore(path, full(expected));
}

void for_each_picture(const FrameModel& model, const ChannelScaling& scaling, const PairSet& pairs,
                      std::span<const std::uint32_t> indices,
                      const std::function<bool(std::size_t, std::span<const float>)>& use) {
  check_sizes(model.settings(), pairs);
  for (std::size_t first = 0; first < indices.size(); first += kBatch) {
    const std::size_t count = std::min(kBatch, indices.size() - first);
    Tensor frames = frames_for(model.settings(), static_cast<Dim>(count));
    for (std::size_t n = 0; n < count; ++n) pairs.input(indices[first + n], scaling, sample(frames, n));
    Tensor pictures = model.infer(frames);
    for (std::size_t n = 0; n < count; ++n)
      if (!use(first + n, sample(pictures, n))) return;
  }
}

}  // namespace supertac
