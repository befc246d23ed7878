#include "models/training/trainer.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "autograd/ops/arithmetic.h"
#include "data/windows/signal_features.h"
#include "data/windows/split.h"
#include "io/numbers/hash.h"
#include "io/numbers/numbers.h"
#include "layers/checkpoint.h"
#include "models/inference/evaluation.h"
#include "models/inference/novelty.h"
#include "models/inference/ranges.h"
#include "models/training/diagnosis.h"

namespace supertac {
namespace {

// Streams of random numbers that must not meet: the seed is shared with splits and batching.
constexpr std::uint64_t kNoiseStream = 0x65707300;
constexpr std::int64_t kStepsPerComparison = 100;

LossTerms values_of(const Loss& loss, double share) {
  const auto value = [share](const Variable& term) { return term.defined() ? share * term.item() : 0; };
  return {value(loss.total), value(loss.reconstruction), value(loss.kld), value(loss.l2), value(loss.ssim)};
}

}  // namespace

void LossTerms::add(const LossTerms& other) {
  total += other.total, reconstruction += other.reconstruction, kld += other.kld;
  l2 += other.l2, ssim += other.ssim;
}

void Trainer::Spreads::clear() {
  for (Spread* spread : all()) spread->clear();
}

void Trainer::Spreads::add(const Spreads& other) {
  pictures.add(other.pictures), targets.add(other.targets), means.add(other.means);
}

Trainer::Trainer(const Examples& examples, std::vector<std::uint32_t> train,
                 std::unique_ptr<Objective> objective, Ranks& ranks)
    : data_(examples),
      objective_(std::move(objective)),
      batching_(std::move(train), static_cast<std::size_t>(objective_->pace().batch),
                objective_->pace().seed),
      state_(model().parameters(), objective_->pace(), objective_->pace().epochs * steps_per_epoch()),
      ranks_(ranks) {
  check_format(examples, model());
  indices_.resize(batching_.batch_size());
  check_lanes(ranks.size(), indices_.size());
  const Dim n = static_cast<Dim>(indices_.size()), lanes = std::min(static_cast<Dim>(kMostLanes), n);
  const Dim first = lanes * ranks.rank() / ranks.size();
  for (Dim i = first; i < first + lanes / ranks.size(); ++i)
    lanes_.emplace_back(*objective_, i * n / lanes, (i + 1) * n / lanes - i * n / lanes);
  for (const Lane& lane : lanes_) lane_parameters_.push_back(&lane.objective->network().parameters());
  std::vector<Tensor> weights;
  for (const Parameter& p : model().parameters()) weights.push_back(p.value.value());
  forms_ = std::make_unique<kernels::WeightForms>(weights);
}

Trainer::Trainer(const WindowSet& windows, std::vector<std::uint32_t> train, const TrainingSettings& settings)
    : Trainer(windows, std::move(train), window_objective(windows, settings)) {}

Trainer::Trainer(const PairSet& pairs, std::vector<std::uint32_t> train,
                 const FrameTrainingSettings& settings)
    : Trainer(pairs, std::move(train), frame_objective(pairs, settings)) {}

Trainer::Lane::Lane(const Objective& master, Dim first_sample, Dim count)
    : first(first_sample),
      objective(master.twin()),
      batch{Tensor(master.network().input_shape(count)), Tensor(master.network().picture_shape(count)), {}} {
  if (master.noise() > 0) batch.noise = Tensor(Shape{count, master.noise()});
  spreads.pictures = spreads.targets = Spread(static_cast<std::size_t>(batch.targets.size() / count));
  spreads.means = Spread(static_cast<std::size_t>(master.latents()));
  share_values(master.network().parameters(), objective->network().parameters());
}

void Trainer::fill(Lane& lane) const {
  const auto per_epoch = static_cast<std::uint64_t>(steps_per_epoch());
  const std::uint64_t epoch = static_cast<std::uint64_t>(step()) / per_epoch;
  const std::uint64_t b = static_cast<std::uint64_t>(step()) % per_epoch;
  const auto count = static_cast<std::size_t>(lane.batch.inputs.dim(0));
  const std::size_t input_size = lane.batch.inputs.values().size() / count;
  const std::size_t target_size = lane.batch.targets.values().size() / count;
  for (std::size_t n = 0; n < count; ++n) {
    const std::size_t slot = static_cast<std::size_t>(lane.first) + n;
    const std::span<float> input = lane.batch.inputs.values().subspan(n * input_size, input_size);
    data_.input(indices_[slot], input);
    if (data_.may_vary(indices_[slot])) objective_->vary(batching_.sample(epoch, b, slot), input);
    data_.target(indices_[slot], lane.batch.targets.values().subspan(n * target_size, target_size));
  }
}

// While this step is computed, a disk may fetch this process's share of the next batch.
void Trainer::announce_next() {
  if (step() + 1 >= total_steps()) return;
  batch_of(step() + 1, indices_);
  const auto first = static_cast<std::size_t>(lanes_.front().first);
  const auto end = static_cast<std::size_t>(lanes_.back().first + lanes_.back().batch.inputs.dim(0));
  for (std::size_t slot = first; slot < end; ++slot) data_.will_read(indices_[slot]);
}

// The numbers of sample i of step s do not depend on how the batch is cut.
void Trainer::draw_noise(Lane& lane) const {
  const RandomStream random(objective_->pace().seed, kNoiseStream);
  const auto numbers = static_cast<std::uint64_t>(objective_->noise());
  if (numbers == 0) return;
  std::uint64_t next =
      (static_cast<std::uint64_t>(step()) * indices_.size() + static_cast<std::uint64_t>(lane.first)) *
      numbers;
  for (real& value : lane.batch.noise.values()) value = static_cast<real>(random.normal(next++));
}

// Forward, loss, backward of one lane, each term weighted by its share of the batch.
void Trainer::run_lane(Lane& lane) const {
  const std::vector<Parameter>& parameters = lane.objective->network().parameters();
  const kernels::WeightForms::Use use(*forms_);
  fill(lane);
  draw_noise(lane);
  drop_gradients(parameters);
  const Outcome outcome = (*lane.objective)(lane.batch);
  const double share = static_cast<double>(lane.batch.inputs.dim(0)) / static_cast<double>(indices_.size());
  lane.terms = values_of(outcome.loss, share);
  lane.spreads.clear();
  lane.spreads.pictures.add(outcome.picture.value());
  lane.spreads.targets.add(lane.batch.targets);
  std::size_t first = 0;
  for (const Variable& mean : outcome.means.span()) {
    lane.spreads.means.add(mean.value(), first);
    first += static_cast<std::size_t>(mean.dim(1));
  }
  if (std::isfinite(lane.terms.total)) return backward(scale(outcome.loss.total, static_cast<real>(share)));
  lane.trouble = where_not_finite(outcome.loss.total, parameters);
}

void Trainer::batch_of(std::int64_t step, std::span<std::uint32_t> out) const {
  const auto number = static_cast<std::uint64_t>(step);
  const auto per_epoch = static_cast<std::uint64_t>(steps_per_epoch());
  batching_.batch(number / per_epoch, number % per_epoch, out);
}

StepReport Trainer::train_step(const std::function<bool()>& stop) {
  if (done())
    throw std::invalid_argument("train_step: all " + std::to_string(total_steps()) + " steps are done");
  announce_next();
  batch_of(step(), indices_);
  forms_->forget();  // Adam has written the weights since, or restore()
#pragma omp parallel for schedule(static, 1)
  for (std::size_t i = 0; i < lanes_.size(); ++i) {
    try {
      run_lane(lanes_[i]);
    } catch (...) {  // an exception must not leave a thread
      lanes_[i].error = std::current_exception();
    }
  }
  StepReport report;
  report.step = step() + 1;
  report.learning_rate = state_.learning_rate();
  for (Lane& lane : lanes_) {
    if (lane.error) std::rethrow_exception(std::exchange(lane.error, nullptr));
  }
  report.stop = stop && stop();
  add_up(report);
  check_finite(report);
  look_for_collapse(report);
  report.gradient_norm = state_.apply(lane_parameters_, ranks_);
  if (step() % kStepsPerComparison == 0) check_same();
  return report;
}

// Of lanes, then of processes, as balanced binary trees.
void Trainer::add_up(StepReport& report) {
  for (std::size_t apart = 1; apart < lanes_.size(); apart *= 2) {
    for (std::size_t lane = 0; lane + apart < lanes_.size(); lane += 2 * apart) {
      lanes_[lane].terms.add(lanes_[lane + apart].terms);
      lanes_[lane].spreads.add(lanes_[lane + apart].spreads);
    }
  }
  Lane& sum = lanes_.front();
  if (ranks_.size() > 1) {
    const auto each = [&](const std::function<void(double&)>& use) {
      LossTerms& t = sum.terms;
      for (double* term : {&t.total, &t.reconstruction, &t.kld, &t.l2, &t.ssim}) use(*term);
      for (Spread* spread : sum.spreads.all())
        for (double& value : spread->values()) use(value);
    };
    statistics_.assign(1, report.stop ? 1 : 0);
    each([&](double& value) { statistics_.push_back(value); });
    of_partner_.resize(statistics_.size());
    ranks_.add_up(statistics_, of_partner_);
    report.stop = statistics_[0] > 0;
    std::size_t next = 1;
    each([&](double& value) { value = statistics_[next++]; });
  }
  report.add(sum.terms);
}

void Trainer::check_finite(const LossTerms& t) const {
  if (std::isfinite(t.total)) return;
  std::string where;
  for (const Lane& lane : lanes_) {
    if (where.empty()) where = lane.trouble;
  }
  for (const std::string& its : ranks_.gather(where)) {
    where = its;
    if (!where.empty()) break;
  }
  const std::string vaes = objective_->latents() == 0 ? ""
                                                      : "reconstruction " + format(t.reconstruction) +
                                                            ", KLD " + format(t.kld) + ", ";
  state_.stop("the loss is " + format(t.total) + " (" + vaes + "L2 " + format(t.l2) + ", SSIM " +
              format(t.ssim) + ")" + (where.empty() ? "" : ": " + where));
}

void Trainer::look_for_collapse(StepReport& report) {
  const Spreads& spreads = lanes_.front().spreads;
  if (indices_.size() < 2) return;  // nothing to compare with
  const auto samples = static_cast<double>(indices_.size());
  report.active_latents = active_latents(spreads.means, samples);
  const bool idle = objective_->latents() > 0 && report.active_latents == 0;
  report.collapsed = state_.collapsed(idle || senseless(spreads.pictures, spreads.targets, samples));
}

// What a saved state must agree in, besides the caller's own metadata.
std::map<std::string, std::string> Trainer::full(std::map<std::string, std::string> metadata) const {
  metadata.merge(objective_->metadata());
  metadata["training"] = objective_->text();
  return metadata;
}

void Trainer::save(const std::string& path, std::map<std::string, std::string> metadata) const {
  check_same();
  if (ranks_.first()) state_.save(path, full(std::move(metadata)));
}

void Trainer::check_same() const {
  if (ranks_.size() == 1) return;
  std::map<std::string, std::string> sums;
  for (const Parameter& p : model().parameters())
    sums[p.name] = std::to_string(crc32(std::as_bytes(std::span<const real>(p.value.value().values()))));
  const std::optional<Disagreement> found = find_disagreement(ranks_, sums);
  if (!found) return;
  throw RanksError("after step " + std::to_string(step()) + " rank " + std::to_string(found->rank) +
                   " holds another " + found->entry + " than the others (CRC-32 " + found->its + ", theirs " +
                   found->usual +
                   "): its memory or its build is faulty; leave that machine out and continue from the last "
                   "state with --resume");
}

void Trainer::save_model(const std::string& path, std::map<std::string, std::string> metadata) const {
  std::vector<StoredTensor> more = novelty();
  more.push_back(ranges());
  write_checkpoint(path, model().parameters(), full(std::move(metadata)), more);
}

// Of an even sample of the training examples, as they are: augmentation hides what is to be noticed.
std::vector<StoredTensor> Trainer::novelty() const {
  constexpr std::size_t kMostSamples = 20'000;
  if (objective_->latents() == 0) return {};  // a frame alone says nothing of its sensor
  std::vector<std::uint32_t> usual;
  std::ranges::copy_if(batching_.indices(), std::back_inserter(usual),
                       [&](std::uint32_t i) { return data_.usual(i); });
  const std::vector<std::uint32_t> chosen = spread(usual, kMostSamples);
  const std::size_t count = signal_feature_count(data_.array());
  if (chosen.size() <= count) return {};
  Tensor features(Shape{static_cast<Dim>(chosen.size()), static_cast<Dim>(count)});
  std::vector<float> window(data_.frames() * data_.array().signals());
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    data_.input(chosen[i], window);
    signal_features(window, data_.array(), features.values().subspan(i * count, count));
  }
  return Novelty(features).stored();
}

StoredTensor Trainer::ranges() const {
  constexpr std::size_t kSamples = 1024;
  ActivationRanges ranges;
  for_each_output(Ensemble({Prepared(model())}), data_, spread(batching_.indices(), kSamples),
                  [&](const EvaluatedBatch& b) {
                    ranges.add(model(), b.inputs);
                    return true;
                  });
  return ranges.stored();
}

void Trainer::restore(const std::string& path, const std::map<std::string, std::string>& expected_metadata) {
  state_.restore(path, full(expected_metadata));
}

}  // namespace supertac
