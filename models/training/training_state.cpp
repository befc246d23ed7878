// What a training has besides its network and data: Adam, the learning rate's schedule, the step and the best
// epoch; saved and restored to the bit.

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <utility>

#include "autograd/kernels/fast/each.h"
#include "io/numbers/numbers.h"
#include "layers/checkpoint.h"
#include "models/training/loss/collapse.h"
#include "models/training/trainer.h"

namespace supertac {
namespace {

void copy_into(Tensor& to, const Tensor& from) { std::copy_n(from.data(), from.size(), to.data()); }

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

void expect_same(const SafetensorsFile& file, const std::string& path,
                 const std::map<std::string, std::string>& expected) {
  for (const auto& [key, value] : expected) {
    const auto found = file.metadata().find(key);
    if (found != file.metadata().end() && found->second == value) continue;
    throw std::runtime_error(path + ": cannot resume: its " + key + " is " +
                             (found == file.metadata().end() ? "missing" : found->second) +
                             ", this run's is " + value +
                             "; give the same options and data, or start anew without --resume");
  }
}

}  // namespace

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
  const auto& micro_batches = micro_batch_parameters_;
#pragma omp parallel for schedule(dynamic)
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    std::array<const real*, kMostMicroBatches> parts;
    for (std::size_t micro_batch = 0; micro_batch < micro_batches.size(); ++micro_batch)
      parts[micro_batch] = (*micro_batches[micro_batch])[i].value.grad().data();
    Tensor& sum = Variable(parameters[i].value).mutable_grad();
    if (parts[0] == nullptr) {  // the loss does not depend on it
      sum.fill(0);
    } else {
      add_as_tree(sum.size(), std::span(parts).first(micro_batches.size()), sum.data());
    }
  }
  if (ranks_.size() > 1) add_up_over_ranks();
  adam_.set_learning_rate(schedule_.at(step_));
  const double norm = adam_.step();
  if (!std::isfinite(norm)) {
    const std::string name = gradient_not_finite(parameters);
    stop(name.empty() ? "the gradient's norm overflows" : "the gradient of " + name + " is not finite");
  }
  ++step_;
  return norm;
}

void Trainer::epoch_scored(double score) {
  ++epochs_since_best_;
  if (!best_.empty() && !(score > best_score_)) return;
  best_.clear();
  for (const Parameter& p : model().parameters()) best_.push_back(p.value.value().clone());
  best_score_ = score, best_epoch_ = step_ / steps_per_epoch(), epochs_since_best_ = 0;
}

void Trainer::use_best() {
  for (std::size_t i = 0; i < best_.size(); ++i) {
    Variable parameter = model().parameters()[i].value;
    copy_into(parameter.mutable_value(), best_[i]);
  }
}

void Trainer::for_each_tensor(const std::function<void(const std::string&, const Tensor&)>& visit) const {
  for (const Parameter& p : model().parameters()) visit(p.name, p.value.value());
  for (std::size_t i = 0; i < model().parameters().size(); ++i) {
    const std::string& name = model().parameters()[i].name;
    visit("optimizer.m." + name, adam_.first_moments()[i]);
    visit("optimizer.v." + name, adam_.second_moments()[i]);
  }
}

void Trainer::save(const std::string& path, std::map<std::string, std::string> origin) const {
  check_same();
  if (!ranks_.first()) return;
  std::map<std::string, std::string> metadata = this->metadata(std::move(origin));
  const std::vector<Parameter>& parameters = model().parameters();
  std::vector<StoredTensor> state;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const Parameter& p = parameters[i];
    state.push_back(to_stored(p, adam_.first_moments()[i], "optimizer.m." + p.name));
    state.push_back(to_stored(p, adam_.second_moments()[i], "optimizer.v." + p.name));
  }
  for (std::size_t i = 0; i < best_.size(); ++i)
    state.push_back(to_stored(parameters[i], best_[i], "optimizer.best." + parameters[i].name));
  if (!best_.empty()) {
    metadata["best_score"] = format(best_score_);
    metadata["best_epoch"] = std::to_string(best_epoch_);
    metadata["epochs_since_best"] = std::to_string(epochs_since_best_);
  }
  metadata["step"] = std::to_string(step_);
  metadata["flat_steps"] = std::to_string(flat_steps_);
  write_checkpoint(path, parameters, std::move(metadata), state);
}

void Trainer::restore(const std::string& path, const std::map<std::string, std::string>& expected_metadata) {
  const SafetensorsFile file = read_checkpoint(path);
  expect_same(file, path, metadata(expected_metadata));
  const auto integer = [&](const char* key) {
    const auto value = parse_int(value_or(file.metadata(), key));
    if (!value || *value < 0 || *value > total_steps()) {
      throw std::runtime_error(path + ": holds no training state (metadata \"" + key +
                               "\"); resume from the last.safetensors of the run's folder");
    }
    return *value;
  };
  const std::int64_t step = integer("step"), flat_steps = integer("flat_steps");
  std::vector<Tensor> m, v;
  for (const Parameter& p : model().parameters()) {
    m.push_back(load_like(file, path, "optimizer.m." + p.name, p));
    v.push_back(load_like(file, path, "optimizer.v." + p.name, p));
  }
  std::vector<Tensor> best;
  std::int64_t best_epoch = 0, since_best = 0;
  if (file.metadata().contains("best_epoch")) {
    best_epoch = integer("best_epoch"), since_best = integer("epochs_since_best");
    for (const Parameter& p : model().parameters())
      best.push_back(load_like(file, path, "optimizer.best." + p.name, p));
  }
  load_parameters(file, path, model().parameters(), {"optimizer."});
  best_ = std::move(best), best_epoch_ = best_epoch, epochs_since_best_ = since_best;
  best_score_ = parse_double(value_or(file.metadata(), "best_score")).value_or(0);
  for (std::size_t i = 0; i < m.size(); ++i) {
    copy_into(adam_.first_moments()[i], m[i]);
    copy_into(adam_.second_moments()[i], v[i]);
  }
  adam_.set_steps(step);
  step_ = step;
  flat_steps_ = static_cast<int>(flat_steps);
}

}  // namespace supertac
