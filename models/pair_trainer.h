// Training of a frame model on pairs, one visible step at a time, with the trainer's rules
// (models/trainer.h): every random choice is a function of (seed, step), and a batch is cut into lanes
// whatever the number of threads, so that a restored trainer continues to the same bits and threads change
// none.
#pragma once

#include <cstdint>
#include <exception>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "data/samples/batching.h"
#include "data/samples/pairs.h"
#include "models/collapse.h"
#include "models/frame_file.h"
#include "models/trainer.h"
#include "models/training_state.h"

namespace supertac {

struct PairTrainingSettings {
  FrameSettings model;  ///< sizes and scale are the pairs'
  double lambda = 0.1;  ///< of 1 - SSIM: loss = L2 + lambda (1 - SSIM), the picture's part of SuperTac's
  std::int64_t epochs = 20;
  std::int64_t batch = 64;
  std::uint64_t seed = 0;
  OptimiserSettings optimiser;

  /// Settings for these pairs.
  static PairTrainingSettings of(const PairSet& pairs);
  /// JSON text of everything that determines the result, for metadata and to compare on resume.
  std::string text() const;
};

class PairTrainer {
 public:
  /// `pairs` must outlive the trainer. The scaling is fitted to `train`. Throws std::invalid_argument for
  /// settings out of range, a model of other sizes than the pairs', or no training pair.
  PairTrainer(const PairSet& pairs, std::vector<std::uint32_t> train, const PairTrainingSettings& settings);

  bool done() const { return state_.done(); }
  std::int64_t step() const { return state_.step(); }
  std::int64_t total_steps() const { return state_.total_steps(); }
  std::int64_t steps_per_epoch() const { return static_cast<std::int64_t>(batching_.batches_per_epoch()); }
  const FrameModel& model() const { return model_; }
  const ChannelScaling& scaling() const { return scaling_; }
  const PairTrainingSettings& settings() const { return settings_; }

  /// One batch: forward, loss, backward, Adam; of the report's terms total, l2 and ssim are used. Throws
  /// TrainingStopped; the parameters are then still finite.
  StepReport train_step();

  /// As Trainer::save and Trainer::restore.
  void save(const std::string& path, std::map<std::string, std::string> metadata) const;
  void restore(const std::string& path, const std::map<std::string, std::string>& expected_metadata);

 private:
  struct Lane {
    Lane(const FrameModel& master, Dim first, Dim count);
    Dim first;         // its share of the batch: samples first .. first + frames.dim(0)
    FrameModel model;  // the master's values under gradients of its own
    Tensor frames, truth;
    StepReport terms;
    Spread pictures, truths;
    std::string trouble;  // where the loss stopped to be finite
    std::exception_ptr error;
  };
  void run_lane(Lane& lane) const;
  bool looks_collapsed();
  std::map<std::string, std::string> full(std::map<std::string, std::string> metadata) const;

  const PairSet& pairs_;
  PairTrainingSettings settings_;
  ChannelScaling scaling_;
  Batching batching_;
  FrameModel model_;
  TrainingState state_;
  Spread pictures_, truths_;
  std::vector<std::uint32_t> indices_;  // of the batch
  std::vector<Lane> lanes_;
  std::vector<const std::vector<Parameter>*> lane_parameters_;
};

/// Runs a model over the given pairs in order and calls use(place in `indices`, output [sH][sW]); false stops
/// early. Throws std::invalid_argument when the pairs do not have the model's sizes.
void for_each_picture(const FrameModel& model, const ChannelScaling& scaling, const PairSet& pairs,
                      std::span<const std::uint32_t> indices,
                      const std::function<bool(std::size_t, std::span<const float>)>& use);

}  // namespace supertac
