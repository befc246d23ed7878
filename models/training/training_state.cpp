// The state of a training, saved and restored to the bit: parameters, Adam's moments, the step and the best
// epoch.

#include <algorithm>
#include <cmath>
#include <utility>

#include "io/numbers/numbers.h"
#include "layers/checkpoint.h"
#include "models/training/trainer.h"

namespace supertac {
namespace {

void copy_into(Tensor& to, const Tensor& from) { std::copy_n(from.data(), from.size(), to.data()); }

void expect_same(const SafetensorsFile& file, const std::map<std::string, std::string>& expected) {
  for (const auto& [key, value] : expected) {
    const auto found = file.metadata().find(key);
    if (found != file.metadata().end() && found->second == value) continue;
    throw std::runtime_error(file.path() + ": cannot resume: its " + key + " is " +
                             (found == file.metadata().end() ? "missing" : found->second) +
                             ", this run's is " + value +
                             "; give the same options and data, or start anew without --resume");
  }
}

}  // namespace

void Trainer::epoch_scored(double score) {
  if (std::isnan(score)) return;  // nothing that was held out is in contact: no epoch is better than others
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

std::vector<Trainer::Moments> Trainer::moments() const {
  std::vector<Moments> all;
  for (std::size_t i = 0; i < model().parameters().size(); ++i) {
    const Parameter& p = model().parameters()[i];
    all.push_back({p, "optimizer.m." + p.name, adam_.first_moments()[i]});
    all.push_back({p, "optimizer.v." + p.name, adam_.second_moments()[i]});
  }
  return all;
}

void Trainer::for_each_tensor(const std::function<void(const std::string&, const Tensor&)>& visit) const {
  for (const Parameter& p : model().parameters()) visit(p.name, p.value.value());
  for (const Moments& m : moments()) visit(m.name, m.values);
}

std::map<std::string, std::string> Trainer::best_entries() const {
  if (best_.empty()) return {};
  return {{"best_score", format(best_score_)},
          {"best_epoch", std::to_string(best_epoch_)},
          {"epochs_since_best", std::to_string(epochs_since_best_)}};
}

void Trainer::save(const std::string& path, std::map<std::string, std::string> origin) const {
  check_same();
  if (!ranks_.first()) return;
  std::map<std::string, std::string> metadata = this->metadata(std::move(origin));
  const std::vector<Parameter>& parameters = model().parameters();
  std::vector<StoredTensor> state;
  for (const Moments& m : moments()) state.push_back(to_stored(m.parameter, m.values, m.name));
  for (std::size_t i = 0; i < best_.size(); ++i)
    state.push_back(to_stored(parameters[i], best_[i], "optimizer.best." + parameters[i].name));
  metadata.merge(best_entries());
  metadata["step"] = std::to_string(step_);
  metadata["flat_steps"] = std::to_string(flat_steps_);
  write_checkpoint(path, parameters, std::move(metadata), state);
}

void Trainer::restore(const std::string& path, const std::map<std::string, std::string>& expected_metadata) {
  const SafetensorsFile file = SafetensorsFile::read(path);
  check_checkpoint(file);
  expect_same(file, metadata(expected_metadata));
  const auto integer = [&](const char* key) {
    const auto value = parse_int(value_or(file.metadata(), key));
    if (!value || *value < 0 || *value > total_steps()) {
      throw std::runtime_error(path + ": holds no training state (metadata \"" + key +
                               "\"); resume from the last.safetensors of the run's folder");
    }
    return *value;
  };
  const std::int64_t step = integer("step"), flat_steps = integer("flat_steps");
  const std::vector<Moments> moments = this->moments();
  std::vector<Tensor> loaded, best;
  for (const Moments& m : moments) loaded.push_back(load_like(file, m.name, m.parameter));
  std::int64_t best_epoch = 0, since_best = 0;
  if (file.metadata().contains("best_epoch")) {
    best_epoch = integer("best_epoch"), since_best = integer("epochs_since_best");
    for (const Parameter& p : model().parameters())
      best.push_back(load_like(file, "optimizer.best." + p.name, p));
  }
  load_parameters(file, model().parameters(), {"optimizer."});
  best_ = std::move(best), best_epoch_ = best_epoch, epochs_since_best_ = since_best;
  best_score_ = parse_double(value_or(file.metadata(), "best_score")).value_or(0);
  for (std::size_t i = 0; i < moments.size(); ++i) copy_into(moments[i].values, loaded[i]);
  adam_.set_steps(step);
  step_ = step;
  flat_steps_ = static_cast<int>(flat_steps);
}

}  // namespace supertac
