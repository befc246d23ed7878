// Training of SuperTac, one visible step at a time.
//
//   Trainer trainer(windows, split.train, settings);
//   while (!trainer.done()) report(trainer.train_step());
//
// Every random choice is a function of (seed, step), so that a restored trainer continues to the same bits.
//
// A batch is cut into lanes, at most four, whatever the number of threads. Each lane runs the whole forward
// and backward pass on its share, on one thread, with gradients of its own; these are added in the order of
// the lanes. So threads meet once per step, and which of them ran a lane changes no bit.
#pragma once

#include <cstdint>
#include <exception>
#include <stdexcept>
#include <string>
#include <vector>

#include "data/samples/augment.h"
#include "data/samples/batching.h"
#include "data/samples/windows.h"
#include "models/collapse.h"
#include "models/loss.h"
#include "models/model_file.h"
#include "models/training_state.h"

namespace supertac {

struct TrainingSettings {
  SuperTacSettings model;
  LossWeights loss;
  AugmentSettings augment;
  std::int64_t epochs = 4;
  std::int64_t batch = 64;
  std::uint64_t seed = 0;
  double learning_rate = 1e-3;
  double warm_up = 0.05;  ///< share of all steps in which the rate rises; then half a cosine to 0
  double clip_norm = 1;   ///< 0 = never
  /// Whether z is drawn around its mean. Without, and with beta 0, the VAEs are plain autoencoders.
  bool sampling = true;

  /// Throws std::invalid_argument naming the setting.
  void check() const;
  /// JSON text of everything that determines the result, for metadata and to compare on resume.
  std::string text() const;
};

struct StepReport {
  std::int64_t step = 0;  ///< from 1
  double total = 0, reconstruction = 0, kld = 0, l2 = 0, ssim = 0;
  double gradient_norm = 0;  ///< before clipping
  double learning_rate = 0;
  int active_latents = 0;  ///< of all groups, in this batch (models/collapse.h)
  /// For the last 100 steps after warm-up the pictures said nothing of the truths, or no latent number was
  /// active (models/collapse.h). Lower the learning rate or, when no latent is active, beta.
  bool collapsed = false;
};

class Trainer {
 public:
  /// `windows` must outlive the trainer. Throws std::invalid_argument for settings out of range, windows of
  /// another length, array or picture size than the model's, or no training window.
  Trainer(const WindowSet& windows, std::vector<std::uint32_t> train, const TrainingSettings& settings);

  bool done() const { return state_.done(); }
  std::int64_t step() const { return state_.step(); }
  std::int64_t total_steps() const { return state_.total_steps(); }
  std::int64_t steps_per_epoch() const { return static_cast<std::int64_t>(batching_.batches_per_epoch()); }
  const SuperTac& model() const { return model_; }
  const TrainingSettings& settings() const { return settings_; }

  /// One batch: forward, loss, backward, Adam. Throws TrainingStopped; the parameters are then still finite.
  StepReport train_step();

  /// Model and training state, a checkpoint like any other with "optimizer." tensors besides. Throws
  /// FileError.
  void save(const std::string& path, std::map<std::string, std::string> metadata) const;
  /// Continues where the saved trainer stood. Throws std::runtime_error when the file holds no training
  /// state, or was made with other settings or data (naming the difference); nothing is changed then.
  void restore(const std::string& path, const std::map<std::string, std::string>& expected_metadata);

 private:
  struct Lane {
    Lane(const SuperTac& master, Dim first, Dim count);
    Dim first;       // its share of the batch: samples first .. first + windows.dim(0)
    SuperTac model;  // the master's values under gradients of its own
    Tensor windows, truth;
    std::vector<Tensor> eps;  // [count,LD] of each group
    StepReport terms;
    Spread pictures, truths, means;
    std::string trouble;  // where the loss stopped to be finite
    std::exception_ptr error;
  };
  void run_lane(Lane& lane) const;
  void fill(Lane& lane) const;
  void draw_eps(Lane& lane) const;
  void look_for_collapse(StepReport& report);
  void check_finite(const StepReport& report) const;
  std::map<std::string, std::string> full(std::map<std::string, std::string> metadata) const;

  const WindowSet& data_;
  TrainingSettings settings_;
  Batching batching_;
  SuperTac model_;
  TrainingState state_;
  Spread pictures_, truths_, means_;
  std::vector<std::uint32_t> indices_;  // of the batch
  std::vector<Lane> lanes_;
  std::vector<const std::vector<Parameter>*> lane_parameters_;  // of these models
};

}  // namespace supertac
