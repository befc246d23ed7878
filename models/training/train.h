// The whole training of a recipe: what supertac-train does, as a function of the library.
//
//   train(Recipe::named("tiny"), "recordings", "model.safetensors");
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "models/training/recipe.h"
#include "models/training/trainer.h"

namespace supertac {

struct TrainingTask {
  std::shared_ptr<const WindowSet> windows;
  Split split = {};
  /// Neither trained on nor tested: what the best epoch is chosen by (Recipe::keeps_best). Empty: the last is
  /// kept.
  std::vector<std::uint32_t> held_out = {};
  Recipe recipe = {};  ///< with the array of the windows
  /// What the model file says of its origin; the same whatever machine, folder or number of threads.
  std::map<std::string, std::string> origin = {};
  std::string counts = {};                ///< where the frames of the recordings went, for people
  bool finds_interval_factor = false;     ///< on the tested windows, after training
  std::size_t overlapping = 0;            ///< count_overlapping() of the split
  std::vector<std::string> notes = {};    ///< what is to be said before training: a range that clips, a leak
  std::vector<std::string> remarks = {};  ///< remarks_on() the training windows
};

/// Both sides of the recipe's split of these windows, and what it holds out of training.
Split split_of(const WindowSet& windows, const Recipe& recipe, std::vector<std::uint32_t>& held_out);

/// Reads a folder of recordings, twice, each time watched; adds random and silent passes, splits. Throws
/// std::invalid_argument as Recipe::check, and when random plates are asked for though the signals rest at
/// another level than the recordings state; std::runtime_error as WindowSet::load, when taxels that should
/// feel do not, and when the signal range clips most of the signals.
TrainingTask window_task(const Recipe& recipe, const std::string& recordings, const ReadingWatch& watch = {});

/// One line of a training's log: means over the steps since the line before.
struct LogLine : LossTerms {
  double time_s = 0;  ///< since training began, pauses between resumed runs left out
  std::int64_t step = 0;
  double gradient_norm = 0, learning_rate = 0;
  /// Means over the test windows in contact among 2,000 evenly spaced ones, at the end of an epoch; training
  /// does not use them.
  std::optional<double> test_ssim, test_psnr_db;
};

struct TrainingCallbacks {
  std::function<bool()> stop = {};  ///< asked during and after every step: whether to end early
  std::function<void(const StepReport& report)> step = {};  ///< after every step, and end_epoch()
  /// Every 50 steps and at the end of every epoch.
  std::function<void(const LogLine& line)> log = {};
  /// Where the state is saved, every so many steps and at the end; "": nowhere.
  std::string checkpoint = {};
  std::int64_t checkpoint_every = 500;
  double seconds_before = 0;  ///< on the log's clock when this process began
};

/// Behind the last step of an epoch: scores 2,000 of the windows that are held out, where there are any, for
/// Trainer::epoch_scored(). Nothing ends it early: a training that is resumed has the same best epoch.
void end_epoch(Trainer& trainer, const TrainingTask& task);

/// Trains until Trainer::done(), or to the end of the step in which `stop` returns true; returns whether all
/// steps are done. Throws as Trainer::train_step and Trainer::save.
bool train(Trainer& trainer, const TrainingTask& task, const TrainingCallbacks& callbacks = {});

/// What the model file says of its origin after training: task.origin, and where the recipe leaves it open
/// the interval: IntervalCoverage::found() of at most 2,000 tested windows, without a load and with one of
/// scale^2, whichever is narrower. A network that draws people or objects for the first time is further off
/// than it has learnt to say.
std::map<std::string, std::string> trained_origin(const Trainer& trainer, const TrainingTask& task);

/// The model alone, ready for use: with `origin` in its metadata, the ranges of its values for int8 and,
/// unless it has too few windows, its Novelty. Throws FileError.
void save_trained(const Trainer& trainer, const std::string& path,
                  const std::map<std::string, std::string>& origin);

/// All of it: reads the recordings, goes on from `callbacks.checkpoint` where that file exists, trains, and
/// writes the model. Returns whether all steps are done; otherwise no model is written. Throws as
/// window_task(), Trainer::restore() and the others above.
bool train(const Recipe& recipe, const std::string& recordings, const std::string& out,
           const TrainingCallbacks& callbacks = {});

}  // namespace supertac
