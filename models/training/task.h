// What is trained on what: the windows that a recipe makes of recordings.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "models/training/objective.h"

namespace supertac {

/// Where recordings lie.
struct RecordingFolders {
  std::string data;
  /// Gives the watch of a folder's reading; empty: none.
  std::function<ReadingWatch(const std::string& folder)> watch = {};
};

struct TrainingTask {
  std::shared_ptr<const WindowSet> windows;
  Split split = {};
  /// Neither trained on nor tested: what the best epoch is chosen by (Recipe::keeps_best). Empty: the last is
  /// kept.
  std::vector<std::uint32_t> held_out = {};
  Objective objective;
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

/// Reads the recordings, adds random and silent passes, splits. Throws std::invalid_argument as
/// Recipe::check, and when random plates are asked for though the signals rest at another level than the
/// recordings state; std::runtime_error as WindowSet::load, and when the signal range clips most of the
/// signals.
TrainingTask window_task(const Recipe& recipe, const RecordingFolders& folders);

}  // namespace supertac
