#include "models/training/training_state.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "autograd/kernels/sums.h"
#include "io/numbers/numbers.h"
#include "layers/checkpoint.h"
#include "models/training/loss/diagnosis.h"

namespace supertac {
namespace {

constexpr int kFlatStepsToReport = 100;

void copy_into(Tensor& to, const Tensor& from) { std::copy_n(from.data(), from.size(), to.data()); }

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

void TrainingPace::check() const {
  const auto require = [](bool holds, const char* what, double got) {
    if (!holds)
      throw std::invalid_argument(std::string("training settings: ") + what + ", got " + format(got));
  };
  require(epochs >= 1 && epochs <= 100'000, "epochs must be 1 to 100000", static_cast<double>(epochs));
  require(batch >= 1 && batch <= 4096, "batch must be 1 to 4096", static_cast<double>(batch));
  require(learning_rate > 0 && learning_rate <= 1, "learning rate must be above 0 and at most 1",
          learning_rate);
  require(warm_up >= 0 && warm_up < 1, "warm-up must be a share of all steps, 0 to below 1", warm_up);
  require(clip_norm >= 0 && std::isfinite(clip_norm), "clip norm must not be negative (0 = never)",
          clip_norm);
}

TrainingState::TrainingState(const std::vector<Parameter>& parameters, const TrainingPace& pace,
                             std::int64_t total_steps)
    : parameters_(parameters),
      adam_(values_of(parameters),
            {.learning_rate = pace.learning_rate, .clip_norm = pace.clip_norm, .muon = pace.muon}),
      schedule_{.peak = pace.learning_rate,
                .warm_up = static_cast<std::int64_t>(pace.warm_up * static_cast<double>(total_steps)),
                .total = total_steps} {}

bool TrainingState::collapsed(bool looks_so) {
  flat_steps_ = looks_so && step_ >= schedule_.warm_up ? flat_steps_ + 1 : 0;
  return flat_steps_ >= kFlatStepsToReport;
}

void TrainingState::add_up_over(Ranks& ranks) {
  sum_.clear();
  for (const Parameter& p : parameters_) {
    const auto gradient = p.value.grad().values();
    sum_.insert(sum_.end(), gradient.begin(), gradient.end());
  }
  of_partner_.resize(sum_.size());
  ranks.add_up(sum_, of_partner_);
  const real* next = sum_.data();
  for (const Parameter& p : parameters_) {
    const auto gradient = Variable(p.value).mutable_grad().values();
    std::copy_n(next, gradient.size(), gradient.data());
    next += gradient.size();
  }
}

double TrainingState::apply(const std::vector<const std::vector<Parameter>*>& micro_batches, Ranks& ranks) {
#pragma omp parallel for schedule(dynamic)
  for (std::size_t i = 0; i < parameters_.size(); ++i) {
    std::array<const real*, kMostMicroBatches> parts;
    for (std::size_t micro_batch = 0; micro_batch < micro_batches.size(); ++micro_batch)
      parts[micro_batch] = (*micro_batches[micro_batch])[i].value.grad().data();
    Tensor& sum = Variable(parameters_[i].value).mutable_grad();
    if (parts[0] == nullptr) {  // the loss does not depend on it
      sum.fill(0);
    } else {
      kernels::add_as_tree(sum.size(), std::span(parts).first(micro_batches.size()), sum.data());
    }
  }
  if (ranks.size() > 1) add_up_over(ranks);
  adam_.set_learning_rate(learning_rate());
  const double norm = adam_.step();
  if (!std::isfinite(norm)) {
    const std::string name = gradient_not_finite(parameters_);
    stop(name.empty() ? "the gradient's norm overflows" : "the gradient of " + name + " is not finite");
  }
  ++step_;
  return norm;
}

void TrainingState::stop(const std::string& what) const {
  throw TrainingStopped("training stopped at step " + std::to_string(step_ + 1) + ": " + what +
                        "; lower --learning-rate (now " + format(schedule_.peak) +
                        ") or check the input with supertac-info");
}

void TrainingState::epoch_scored(double score, std::int64_t epoch) {
  ++epochs_since_best_;
  if (!best_.empty() && !(score > best_score_)) return;
  best_.clear();
  for (const Parameter& p : parameters_) best_.push_back(p.value.value().clone());
  best_score_ = score, best_epoch_ = epoch, epochs_since_best_ = 0;
}

void TrainingState::use_best() {
  for (std::size_t i = 0; i < best_.size(); ++i) {
    Variable parameter = parameters_[i].value;
    copy_into(parameter.mutable_value(), best_[i]);
  }
}

void TrainingState::for_each_tensor(
    const std::function<void(const std::string&, const Tensor&)>& visit) const {
  for (const Parameter& p : parameters_) visit(p.name, p.value.value());
  for (std::size_t i = 0; i < parameters_.size(); ++i) {
    visit("optimizer.m." + parameters_[i].name, adam_.first_moments()[i]);
    visit("optimizer.v." + parameters_[i].name, adam_.second_moments()[i]);
  }
}

void TrainingState::save(const std::string& path, std::map<std::string, std::string> metadata) const {
  std::vector<StoredTensor> state;
  for (std::size_t i = 0; i < parameters_.size(); ++i) {
    const Parameter& p = parameters_[i];
    state.push_back(to_stored(p, adam_.first_moments()[i], "optimizer.m." + p.name));
    state.push_back(to_stored(p, adam_.second_moments()[i], "optimizer.v." + p.name));
  }
  for (std::size_t i = 0; i < best_.size(); ++i)
    state.push_back(to_stored(parameters_[i], best_[i], "optimizer.best." + parameters_[i].name));
  if (!best_.empty()) {
    metadata["best_score"] = format(best_score_);
    metadata["best_epoch"] = std::to_string(best_epoch_);
    metadata["epochs_since_best"] = std::to_string(epochs_since_best_);
  }
  metadata["step"] = std::to_string(step_);
  metadata["flat_steps"] = std::to_string(flat_steps_);
  write_checkpoint(path, parameters_, std::move(metadata), state);
}

void TrainingState::restore(const std::string& path, const std::map<std::string, std::string>& expected) {
  const SafetensorsFile file = read_checkpoint(path);
  expect_same(file, path, expected);
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
  for (const Parameter& p : parameters_) {
    m.push_back(load_like(file, path, "optimizer.m." + p.name, p));
    v.push_back(load_like(file, path, "optimizer.v." + p.name, p));
  }
  std::vector<Tensor> best;
  std::int64_t best_epoch = 0, since_best = 0;
  if (file.metadata().contains("best_epoch")) {
    best_epoch = integer("best_epoch"), since_best = integer("epochs_since_best");
    for (const Parameter& p : parameters_)
      best.push_back(load_like(file, path, "optimizer.best." + p.name, p));
  }
  load_parameters(file, path, parameters_, {"optimizer."});
  best_ = std::move(best), best_epoch_ = best_epoch, epochs_since_best_ = since_best;
  best_score_ = parse_double(value_or(file.metadata(), "best_score")).value_or(0);
  for (std::size_t i = 0; i < parameters_.size(); ++i) {
    copy_into(adam_.first_moments()[i], m[i]);
    copy_into(adam_.second_moments()[i], v[i]);
  }
  adam_.set_steps(step);
  step_ = step;
  flat_steps_ = static_cast<int>(flat_steps);
}

void share_values(const std::vector<Parameter>& master, const std::vector<Parameter>& micro_batch) {
  for (std::size_t i = 0; i < master.size(); ++i) {
    Variable own = micro_batch[i].value;
    own.mutable_value() = master[i].value.value();  // the same buffer
  }
}

void drop_gradients(const std::vector<Parameter>& parameters) {
  for (const Parameter& p : parameters) Variable(p.value).drop_grad();
}

}  // namespace supertac
