#include "models/training/trainer.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <functional>
#include <utility>

#include "autograd/kernels/fast/each.h"
#include "autograd/ops/arithmetic.h"
#include "io/numbers/hash.h"
#include "io/numbers/numbers.h"
#include "models/inference/evaluation.h"
#include "models/training/loss/collapse.h"

namespace supertac {
namespace {

// Streams of random numbers that must not meet: the seed is shared with splits and batching.
constexpr std::uint64_t kNoiseStream = 0x65707300;
constexpr std::int64_t kStepsPerComparison = 100;
constexpr int kFlatStepsToReport = 100;

const Recipe& checked(const Recipe& recipe, const TaxelArray& array) {
  recipe.check();
  check(recipe.augment, array);
  return recipe;
}

SuperTac network_of(const SuperTacSettings& settings, Rng rng) { return SuperTac(settings, rng); }

constexpr Dim kTreeBlock = 1024;  // so that what the tree adds up on its way stays in the first cache

// The left half of the tree is a whole one: as many parts as the largest power of two below their number.
void add_block(Dim n, Dim at, std::span<const real* const> parts, real* y) {
  if (parts.size() == 1) {
    std::copy_n(parts[0] + at, n, y);
    return;
  }
  if (parts.size() == 8) {  // eight micro-batches: eight streams that are fetched side by side
    const real *a = parts[0] + at, *b = parts[1] + at, *c = parts[2] + at, *d = parts[3] + at;
    const real *e = parts[4] + at, *f = parts[5] + at, *g = parts[6] + at, *h = parts[7] + at;
    return kernels::each(
        n, [=](Dim i) { y[i] = ((a[i] + b[i]) + (c[i] + d[i])) + ((e[i] + f[i]) + (g[i] + h[i])); });
  }
  const std::size_t left = std::bit_ceil(parts.size()) / 2;
  std::array<real, kTreeBlock> right;
  add_block(n, at, parts.first(left), y);
  add_block(n, at, parts.subspan(left), right.data());
  kernels::each(n, [y, other = right.data()](Dim i) { y[i] += other[i]; });
}

// y = the sum of all parts (at least one) as a balanced binary tree: neighbours, then pairs of pairs; -0
// becomes +0.
void add_as_tree(Dim n, std::span<const real* const> parts, real* y) {
  for (Dim at = 0; at < n; at += kTreeBlock) {
    const Dim count = std::min(kTreeBlock, n - at);
    add_block(count, at, parts, y + at);
    kernels::each(count, [to = y + at](Dim i) { to[i] += 0; });
  }
}

}  // namespace

Trainer::Trainer(const WindowSet& windows, std::vector<std::uint32_t> train, const Recipe& recipe,
                 Ranks& ranks)
    : windows_(windows),
      recipe_(checked(recipe, windows.array())),
      input_(input_of(windows)),
      model_(network_of(recipe_.model, Rng(recipe_.seed))),
      batching_(std::move(train), static_cast<std::size_t>(recipe_.batch), recipe_.seed),
      adam_(values_of(model_.parameters()),
            {.learning_rate = recipe_.learning_rate, .clip_norm = recipe_.clip_norm, .muon = recipe_.muon}),
      schedule_{.peak = recipe_.learning_rate,
                .warm_up = static_cast<std::int64_t>(recipe_.warm_up *
                                                     static_cast<double>(recipe_.epochs * steps_per_epoch())),
                .total = recipe_.epochs * steps_per_epoch()},
      ranks_(ranks) {
  check_format(windows, model_);
  indices_.resize(batching_.batch_size());
  check_micro_batches(ranks.size(), indices_.size());
  const Dim n = static_cast<Dim>(indices_.size()),
            micro_batches = static_cast<Dim>(micro_batches_of(indices_.size()));
  const Dim first = micro_batches * ranks.rank() / ranks.size();
  const Dim noise = recipe_.sampling ? recipe_.model.latents() : 0;
  for (Dim i = first; i < first + micro_batches / ranks.size(); ++i)
    micro_batches_.emplace_back(model_, noise, i * n / micro_batches,
                                (i + 1) * n / micro_batches - i * n / micro_batches);
}

Trainer::MicroBatch::MicroBatch(const SuperTac& master, Dim noise, Dim first_sample, Dim count)
    : first(first_sample),
      network(network_of(master.settings(), Rng::zeros())),
      batch{Tensor(master.input_shape(count)), Tensor(master.picture_shape(count)), {}},
      statistics(master) {
  if (noise > 0) batch.noise = Tensor(Shape{count, noise});
  const auto &of_master = master.parameters(), &own = network.parameters();
  for (std::size_t i = 0; i < own.size(); ++i)
    Variable(own[i].value).mutable_value() = of_master[i].value.value();  // the same buffer
}

// Takes the windows [n,T,signals] and truths [n,H,W,1] of this step, n the samples of a micro-batch, and
// augments each by the number of its sample.
void Trainer::fill(MicroBatch& micro_batch) const {
  const auto count = static_cast<std::size_t>(micro_batch.batch.inputs.dim(0));
  const std::size_t input_size = micro_batch.batch.inputs.values().size() / count;
  const std::size_t target_size = micro_batch.batch.targets.values().size() / count;
  for (std::size_t n = 0; n < count; ++n) {
    const std::size_t slot = static_cast<std::size_t>(micro_batch.first) + n;
    const std::span<float> input =  // [T,signals]
        micro_batch.batch.inputs.values().subspan(n * input_size, input_size);
    windows_.window(indices_[slot], input);
    const std::span<float> target =  // [H,W,1]
        micro_batch.batch.targets.values().subspan(n * target_size, target_size);
    windows_.truth(indices_[slot], target);
    if (recipe_.augment.any() && windows_.augmentable(indices_[slot]))
      augment(recipe_.augment, recipe_.seed, batching_.sample(static_cast<std::uint64_t>(step()), slot),
              input, windows_.array());
  }
}

// The numbers of sample i of step s do not depend on how the batch is cut.
void Trainer::draw_noise(MicroBatch& micro_batch) const {
  if (!micro_batch.batch.noise.defined()) return;
  const RandomStream random(recipe_.seed, kNoiseStream);
  const auto numbers = static_cast<std::uint64_t>(micro_batch.batch.noise.dim(1));
  std::uint64_t next =
      (static_cast<std::uint64_t>(step()) * indices_.size() + static_cast<std::uint64_t>(micro_batch.first)) *
      numbers;
  for (real& value : micro_batch.batch.noise.values()) value = static_cast<real>(random.normal(next++));
}

// A group's columns of the noise; zeros without sampling.
PerGroup<Tensor> Trainer::eps_of(const Batch& batch) const {
  const Dim samples = batch.inputs.dim(0), latent = recipe_.model.latent;
  PerGroup<Tensor> eps(static_cast<std::size_t>(recipe_.model.groups()));
  for (std::size_t g = 0; g < eps.size(); ++g) {
    eps[g] = Tensor::zeros(Shape{samples, latent});
    for (Dim n = 0; batch.noise.defined() && n < samples; ++n) {
      const real* from = batch.noise.data() + n * batch.noise.dim(1) + static_cast<Dim>(g) * latent;
      std::copy_n(from, latent, eps[g].data() + n * latent);
    }
  }
  return eps;
}

// Goes forward, through the loss and backward for one micro-batch; its share of the batch weighs each term.
void Trainer::run(MicroBatch& micro_batch) const {
  const std::vector<Parameter>& parameters = micro_batch.network.parameters();
  fill(micro_batch);
  draw_noise(micro_batch);
  for (const Parameter& p : parameters)
    Variable(p.value).mutable_grad() = Tensor();  // backward() makes others
  Statistics& statistics = micro_batch.statistics;
  std::ranges::fill(statistics.values, 0);
  statistics.targets().add(micro_batch.batch.targets);
  Loss loss;
  {  // what the loss does not need is free before the way back
    const SuperTac::Output drawn =
        micro_batch.network.forward(micro_batch.batch.inputs, eps_of(micro_batch.batch));
    loss = supertac_loss(drawn, micro_batch.batch.targets, recipe_.loss);
    statistics.pictures().add(drawn.picture.value());
    std::size_t first = 0;
    for (const LatentDistribution& latent : drawn.latent) {  // [n,LD] of each group
      statistics.means().add(latent.mean.value(), first);
      first += static_cast<std::size_t>(latent.mean.dim(1));
    }
  }
  const double share =
      static_cast<double>(micro_batch.batch.inputs.dim(0)) / static_cast<double>(indices_.size());
  LossTerms terms = terms_of(loss, share);
  std::ranges::transform(terms.all(), statistics.terms().begin(), [](const double* term) { return *term; });
  if (std::isfinite(terms.total)) return backward(static_cast<real>(share) * loss.total);
  micro_batch.trouble = where_not_finite(loss.total, parameters);
}

void Trainer::windows_of_step(std::int64_t step, std::span<std::uint32_t> out) const {
  batching_.batch(static_cast<std::uint64_t>(step), out);
}

StepReport Trainer::train_step(const std::function<bool()>& stop, const AroundMicroBatch& around) {
  if (done())
    refuse("Trainer", "train_step()", "a step of " + std::to_string(total_steps()) + " left", "none");
  windows_of_step(step(), indices_);
#pragma omp parallel for schedule(static, 1)
  for (std::size_t i = 0; i < micro_batches_.size(); ++i) {
    try {
      MicroBatch& micro_batch = micro_batches_[i];
      if (!around) {
        run(micro_batch);
      } else {
        around(i, micro_batch.batch, micro_batch.network.parameters(), [&] { run(micro_batch); });
      }
    } catch (...) {  // an exception must not leave a thread
      micro_batches_[i].error = std::current_exception();
    }
  }
  StepReport report;
  report.step = step() + 1;
  report.learning_rate = schedule_.at(step_);
  for (MicroBatch& micro_batch : micro_batches_) {
    if (micro_batch.error) std::rethrow_exception(std::exchange(micro_batch.error, nullptr));
  }
  report.stop = stop && stop();
  add_up_statistics(report);
  check_finite(report);
  look_for_collapse(report);
  report.gradient_norm = apply();
  if (step() % kStepsPerComparison == 0) check_same();
  return report;
}

Trainer::Statistics::Statistics(const SuperTac& network)
    : pixels(static_cast<std::size_t>(network.picture_shape(1).elements())),
      values(6 + 4 * pixels + 2 * static_cast<std::size_t>(network.settings().latents())) {}

// Of micro-batches, then of processes, as balanced binary trees; Trainer::apply() adds the gradients.
void Trainer::add_up_statistics(StepReport& report) {
  for (std::size_t apart = 1; apart < micro_batches_.size(); apart *= 2) {
    for (std::size_t micro_batch = 0; micro_batch + apart < micro_batches_.size(); micro_batch += 2 * apart) {
      std::vector<double>& sum = micro_batches_[micro_batch].statistics.values;
      const std::vector<double>& more = micro_batches_[micro_batch + apart].statistics.values;
      std::ranges::transform(sum, more, sum.begin(), std::plus());
    }
  }
  Statistics& sum = micro_batches_.front().statistics;
  sum.values[0] = report.stop ? 1 : 0;
  of_partner_.resize(sum.values.size());
  ranks_.add_up(sum.values, of_partner_);
  report.stop = sum.values[0] > 0;
  for (std::size_t i = 0; i < sum.terms().size(); ++i) *report.all()[i] = sum.terms()[i];
}

void Trainer::check_finite(const LossTerms& t) const {
  if (std::isfinite(t.total)) return;
  std::string where;
  for (const MicroBatch& micro_batch : micro_batches_) {
    if (where.empty()) where = micro_batch.trouble;
  }
  for (const std::string& its : ranks_.gather(where)) {
    where = its;
    if (!where.empty()) break;
  }
  give_up(t.text() + (where.empty() ? "" : ": " + where));
}

void Trainer::look_for_collapse(StepReport& report) {
  Statistics& sums = micro_batches_.front().statistics;
  if (indices_.size() < 2) return;  // nothing to compare with
  const auto samples = static_cast<double>(indices_.size());
  report.active_latents = active_latents(sums.means(), samples);
  const bool idle = recipe_.model.latents() > 0 && report.active_latents == 0;
  const bool flat = idle || is_degenerate(sums.pictures(), sums.targets(), samples);
  flat_steps_ = flat && step_ >= schedule_.warm_up ? flat_steps_ + 1 : 0;
  report.collapsed = flat_steps_ >= kFlatStepsToReport;
}

void Trainer::add_up_over_ranks() {
  sum_.clear();
  for (const Parameter& p : model().parameters()) {
    const auto gradient = p.value.grad().values();
    sum_.insert(sum_.end(), gradient.begin(), gradient.end());
  }
  of_partner_sum_.resize(sum_.size());
  ranks_.add_up(sum_, of_partner_sum_);
  const real* next = sum_.data();
  for (const Parameter& p : model().parameters()) {
    const auto gradient = Variable(p.value).mutable_grad().values();
    std::copy_n(next, gradient.size(), gradient.data());
    next += gradient.size();
  }
}

// Sets the gradients to the sum of the micro-batches', a balanced binary tree (pairs of neighbours, then
// pairs of pairs), then over the ranks; applies Adam; counts the step. Returns the gradient's norm before
// clipping. Throws TrainingStopped when it is not finite; parameters, moments and step are as they were.
double Trainer::apply() {
  const std::vector<Parameter>& parameters = model().parameters();
#pragma omp parallel for schedule(dynamic)
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    std::array<const real*, kMostMicroBatches> parts;
    for (std::size_t k = 0; k < micro_batches_.size(); ++k)
      parts[k] = micro_batches_[k].network.parameters()[i].value.grad().data();
    Tensor& sum = Variable(parameters[i].value).mutable_grad();
    if (parts[0] == nullptr) {  // the loss does not depend on it
      sum.fill(0);
    } else {
      add_as_tree(sum.size(), std::span(parts).first(micro_batches_.size()), sum.data());
    }
  }
  if (ranks_.size() > 1) add_up_over_ranks();
  adam_.set_learning_rate(schedule_.at(step_));
  const double norm = adam_.step();
  if (!std::isfinite(norm)) {
    const std::string name = gradient_not_finite(parameters);
    give_up(name.empty() ? "the gradient's norm overflows" : "the gradient of " + name + " is not finite");
  }
  ++step_;
  return norm;
}

// Of a model file and of a saved state: the caller's, the network's and the training's, in which a state that
// is resumed must agree.
std::map<std::string, std::string> Trainer::metadata(std::map<std::string, std::string> origin) const {
  origin.merge(model_metadata(recipe_.model, input_));
  origin["training"] = training_text(recipe_);
  return origin;
}

void Trainer::give_up(const std::string& what) const {
  throw TrainingStopped("training stopped at step " + std::to_string(step_ + 1) + ": " + what +
                        "; lower --learning-rate (now " + format(schedule_.peak) +
                        ") or check the input with supertac-info");
}

void Trainer::check_same() const {
  if (ranks_.size() == 1) return;
  std::map<std::string, std::string> sums;
  for (const Parameter& p : model().parameters())
    sums[p.name] = std::to_string(crc32(std::as_bytes(std::span<const real>(p.value.value().values()))));
  const std::optional<Disagreement> found = find_disagreement(ranks_, sums);
  if (!found) return;
  throw RanksError("after step " + std::to_string(step()) + " rank " + std::to_string(found->rank) +
                   " holds another " + found->entry + " than rank 0 (CRC-32 " + found->its + ", " +
                   found->of_first +
                   "): its memory or its build is faulty; leave that machine out and continue from the last "
                   "state with --resume");
}

}  // namespace supertac
