// Training of a network, one visible step at a time.
//
//   Trainer trainer(windows, split.train, recipe);
//   while (!trainer.done()) report(trainer.train_step());
//
// Every random choice is a function of (seed, step), so that a restored trainer continues to the same bits.
//
// A batch is cut into micro-batches, at most sixteen, whatever the number of threads. Each micro-batch runs
// the whole forward and backward pass on its share, on one thread, with gradients of its own; these are added
// as a balanced binary tree. So threads meet once per step, and which of them ran a micro-batch changes no
// bit. Several processes share the micro-batches (models/training/ranks.h), each a subtree, and go on to the
// same bits as one.
#pragma once

#include <cstdint>
#include <exception>
#include <functional>
#include <map>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "autograd/optimisers/adam.h"
#include "data/windows/batching.h"
#include "data/windows/windows.h"
#include "models/files/model_file.h"
#include "models/training/loss/collapse.h"
#include "models/training/ranks.h"
#include "models/training/recipe.h"

namespace supertac {

/// One batch, or a micro-batch's share of it.
struct Batch {
  Tensor inputs, targets;  ///< as SuperTac::input_shape() and picture_shape() have it
  /// [N,G LD], ~ N(0,1), LD columns a group; undefined without sampling: z = mean.
  Tensor noise;
};

struct StepReport : LossTerms {
  std::int64_t step = 0;     ///< from 1
  double gradient_norm = 0;  ///< before clipping
  double learning_rate = 0;
  int active_latents = 0;  ///< of all groups, in this batch (models/training/loss/collapse.h)
  /// For the last 100 steps after warm-up is_degenerate() was true, or no latent number was active
  /// (models/training/loss/collapse.h). Lower the learning rate or, when no latent is active, beta.
  bool collapsed = false;
  bool stop = false;  ///< whether a process asked to stop after this step
};

/// A value was not finite: step, where, and what to do are in what().
class TrainingStopped : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Stands around each micro-batch of a step, on its thread (models/training/audit/opened_step.h): must call
/// `run`, which fills the batch and goes forward and backward. `parameters`: the model's values under
/// gradients of their own.
using AroundMicroBatch =
    std::function<void(std::size_t number, const Batch& batch, const std::vector<Parameter>& parameters,
                       const std::function<void()>& run)>;

class Trainer {
 public:
  /// `windows` and `ranks` must outlive the trainer. Throws std::invalid_argument naming the setting of the
  /// recipe, for windows of another format than the network's, no training window, or as
  /// check_micro_batches(). `ranks` train together: all of them call train_step() and save().
  Trainer(const WindowSet& windows, std::vector<std::uint32_t> train, const Recipe& recipe,
          Ranks& ranks = one_process());

  bool done() const { return step_ >= schedule_.total || epochs_since_best_ >= kPatience; }
  std::int64_t step() const { return step_; }  ///< done so far
  std::int64_t total_steps() const { return schedule_.total; }
  std::int64_t steps_per_epoch() const { return static_cast<std::int64_t>(batching_.batches_per_epoch()); }
  /// A network is over-trained when what it was not trained on gets worse: of the scored epochs the best
  /// network is kept, and after kPatience others the training is done.
  static constexpr std::int64_t kPatience = 5;
  void epoch_scored(double score);
  /// Sets the parameters to those of the best epoch, where any was scored.
  void use_best();
  /// Of the best epoch, in the order of the parameters; empty until one was scored.
  const std::vector<Tensor>& best() const { return best_; }
  /// What a saved state says of it: "best_score", "best_epoch" and "epochs_since_best".
  std::map<std::string, std::string> best_entries() const;
  std::int64_t best_epoch() const { return best_epoch_; }  ///< from 1; 0: none was scored
  double best_score() const { return best_score_; }
  const Recipe& recipe() const { return recipe_; }
  const SuperTac& model() const { return model_; }
  const WindowSet& windows() const { return windows_; }
  /// The windows that are trained on.
  const std::vector<std::uint32_t>& training_side() const { return batching_.indices(); }
  /// Number of the processes that train together.
  int ranks() const { return ranks_.size(); }

  /// One batch: forward, loss, backward, Adam. Throws TrainingStopped, the parameters then still being
  /// finite; std::invalid_argument after the last step. `stop` is asked before the gradients are added up.
  /// With several processes throws as check_same(), which is called every 100 steps.
  StepReport train_step(const std::function<bool()>& stop = {}, const AroundMicroBatch& around = {});
  /// Throws RanksError naming rank and tensor when the processes' parameters are not the same to the bit.
  void check_same() const;

  // For an audit (models/training/audit):
  /// The windows of the last step, as many as a batch holds.
  std::span<const std::uint32_t> last_windows() const { return indices_; }
  /// Those of any step, from 0.
  void windows_of_step(std::int64_t step, std::span<std::uint32_t> out) const;
  /// The parameters, then the two moments of each in turn, named as in a checkpoint.
  void for_each_tensor(const std::function<void(const std::string&, const Tensor&)>& visit) const;

  /// Model and training state, a checkpoint like any other with "optimizer." tensors besides. Of several
  /// processes only the first writes, after check_same(). Throws FileError.
  void save(const std::string& path, std::map<std::string, std::string> metadata) const;
  /// `origin` with what there is to say of network, input and training.
  std::map<std::string, std::string> metadata(std::map<std::string, std::string> origin) const;
  /// Continues where the saved trainer stood. Throws std::runtime_error when the file holds no training
  /// state, or was made with other settings or data (naming the difference); nothing is changed then.
  void restore(const std::string& path, const std::map<std::string, std::string>& expected_metadata);

 private:
  /// What micro-batches, then processes add up, in one piece: whether to stop, the terms of the loss, how
  /// pictures, truths and the latents' means vary.
  struct Statistics {
    explicit Statistics(const SuperTac& network);
    std::size_t pixels;
    std::vector<double> values;
    std::span<double> terms() { return std::span(values).subspan(1, 5); }
    BatchVariance pictures() { return {std::span(values).subspan(6, 2 * pixels)}; }
    BatchVariance targets() { return {std::span(values).subspan(6 + 2 * pixels, 2 * pixels)}; }
    BatchVariance means() { return {std::span(values).subspan(6 + 4 * pixels)}; }
  };
  struct MicroBatch {
    MicroBatch(const SuperTac& master, Dim noise, Dim first, Dim count);
    Dim first;         // its share of the batch: samples first .. first + inputs.dim(0)
    SuperTac network;  // the master's values under gradients of its own
    Batch batch;
    Statistics statistics;
    std::string trouble;  // where the loss stopped being finite
    std::exception_ptr error;
  };
  // These work on one micro-batch: take windows and truths, draw noise, go forward and backward.
  void fill(MicroBatch& micro_batch) const;
  void draw_noise(MicroBatch& micro_batch) const;
  PerGroup<Tensor> eps_of(const Batch& batch) const;
  void run(MicroBatch& micro_batch) const;
  // Of all of them: the statistics, into the report, and what these say.
  void add_up_statistics(StepReport& report);
  void check_finite(const LossTerms& terms) const;
  void look_for_collapse(StepReport& report);
  /// Throws TrainingStopped: step, `what`, and advice.
  [[noreturn]] void give_up(const std::string& what) const;
  // Adds up the gradients and moves the weights.
  double apply();
  /// Adam's moments of each parameter, named as in a checkpoint.
  struct Moments {
    const Parameter& parameter;
    std::string name;
    Tensor& values;
  };
  std::vector<Moments> moments() const;
  void add_up_over_ranks();

  const WindowSet& windows_;
  Recipe recipe_;
  InputSettings input_;
  SuperTac model_;
  Batching batching_;
  mutable Adam adam_;
  Schedule schedule_;
  Ranks& ranks_;
  std::int64_t step_ = 0;
  int flat_steps_ = 0;        // in a row that look collapsed, from the end of the warm-up on
  std::vector<Tensor> best_;  // the parameters of the best epoch
  double best_score_ = 0;
  std::int64_t best_epoch_ = 0, epochs_since_best_ = 0;
  std::vector<real> sum_, of_partner_sum_;  // all gradients in one piece, of several processes
  std::vector<double> of_partner_;
  std::vector<std::uint32_t> indices_;     // of the batch
  std::vector<MicroBatch> micro_batches_;  // of this process
};

}  // namespace supertac
