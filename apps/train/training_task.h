// What is trained on what: windows of recordings, or pairs of images.
#pragma once

#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "apps/common/command_line/arguments.h"
#include "data/windows/split.h"
#include "models/training/objective.h"

namespace supertac {

struct TrainingTask {
  const Examples& examples;  ///< must outlive the task
  std::string unit;          ///< what they are: "windows" or "pairs"
  Split split;
  std::unique_ptr<Objective> objective;
  /// What the model file says of its origin; the same whatever machine, folder or number of threads.
  std::map<std::string, std::string> origin{};
  /// More for the run's settings.
  nlohmann::ordered_json about = nlohmann::ordered_json::object();
  std::string warning{};  ///< of a split that leaks; "" = none
};

/// --split of the windows, with settings.seed. Throws as make_split.
TrainingTask window_task(const Arguments& a, const WindowSet& windows, const TrainingSettings& settings);

/// --split of the pairs, with --seed and the options of declare_training(); sets the pairs' scaling. Throws
/// as split_pairs, UsageError.
TrainingTask pair_task(const Arguments& a, PairSet& pairs);

}  // namespace supertac
