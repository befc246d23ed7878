// What a training run has besides its network and data: Adam, the learning rate's schedule, the step; saved
// and restored to the bit.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "autograd/optimisers/adam.h"
#include "layers/module.h"
#include "models/training/loss/schedule.h"
#include "models/training/ranks.h"

namespace supertac {

/// Length, batches and learning rate of a training, whatever the network.
struct TrainingPace {
  std::int64_t epochs = 20;  ///< 1 to 100,000
  std::int64_t batch = 64;   ///< 1 to 4096
  std::uint64_t seed = 0;
  double learning_rate = 1e-3;  ///< Adam's peak, above 0 and at most 1
  double warm_up = 0.05;        ///< share of all steps in which the rate rises; then half a cosine to 0
  double clip_norm = 1;         ///< 0 = never
  bool muon = false;            ///< as AdamOptions::muon

  /// Throws std::invalid_argument naming the setting.
  void check() const;
};

/// A value was not finite: step, where, and what to do are in what().
class TrainingStopped : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

class TrainingState {
 public:
  /// The parameters' handles are kept.
  TrainingState(const std::vector<Parameter>& parameters, const TrainingPace& pace, std::int64_t total_steps);

  std::int64_t step() const { return step_; }  ///< done so far
  std::int64_t total_steps() const { return schedule_.total; }
  bool done() const { return step_ >= schedule_.total || epochs_since_best_ >= kPatience; }

  /// A network is over-trained when what it was not trained on gets worse: of the scored epochs the best
  /// network is kept, and after kPatience others the training is done.
  static constexpr std::int64_t kPatience = 5;
  void epoch_scored(double score, std::int64_t epoch);
  /// Sets the parameters to those of the best epoch, where any was scored.
  void use_best();
  std::int64_t best_epoch() const { return best_epoch_; }  ///< from 1; 0: none was scored
  double best_score() const { return best_score_; }

  double learning_rate() const { return schedule_.at(step_); }

  /// Counts the steps in a row that look collapsed, from the end of the warm-up on. True from the 100th on.
  bool collapsed(bool looks_so);

  /// Sets the gradients to the sum of the micro-batches', which is taken as a balanced binary tree (pairs of
  /// neighbours, then pairs of pairs), then over `ranks`; applies Adam; counts the step. Returns the
  /// gradient's norm before clipping. Throws TrainingStopped when it is not finite; parameters, moments and
  /// step are as they were.
  double apply(const std::vector<const std::vector<Parameter>*>& micro_batches, Ranks& ranks);
  /// Throws TrainingStopped: step, `what`, and advice.
  [[noreturn]] void stop(const std::string& what) const;

  /// Every array of the state: the parameters, then Adam's first and second moments, named as in a
  /// checkpoint.
  void for_each_tensor(const std::function<void(const std::string&, const Tensor&)>& visit) const;

  /// Parameters and state, a checkpoint like any other with "optimizer." tensors besides. Throws FileError.
  void save(const std::string& path, std::map<std::string, std::string> metadata) const;
  /// Continues where the saved state stood. Throws std::runtime_error when the file holds no training state,
  /// or one of `expected` differs from its metadata (naming the difference); nothing is changed then.
  void restore(const std::string& path, const std::map<std::string, std::string>& expected);

 private:
  void add_up_over(Ranks& ranks);

  std::vector<Parameter> parameters_;
  mutable Adam adam_;
  Schedule schedule_;
  std::int64_t step_ = 0;
  int flat_steps_ = 0;
  std::vector<Tensor> best_;  // the parameters of the best epoch
  double best_score_ = 0;
  std::int64_t best_epoch_ = 0, epochs_since_best_ = 0;
  std::vector<real> sum_, of_partner_;  // all gradients in one piece, of several processes
};

/// Makes a micro-batch's parameters share the master's values under gradients of their own.
void share_values(const std::vector<Parameter>& master, const std::vector<Parameter>& micro_batch);
/// So that backward() sets the gradients instead of adding to them.
void drop_gradients(const std::vector<Parameter>& parameters);

}  // namespace supertac
