// A step of a training, opened: every operator that ran, forward and in reverse, with the SHA-256 of all that
// went into it and came out, from the state before the step to the state behind it. So two trainings that
// should be the same can be compared down to the operator where they part, and a single operator can be
// computed again.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "models/training/trainer.h"

namespace supertac {

struct OpenedStep {
  std::int64_t step = 0;  ///< from 1
  /// In the order in which they ran; docs/audit.md has their fields.
  nlohmann::ordered_json operators;
  /// Those that were to be kept, by what the operators call them: SHA-256 and shape.
  std::map<std::string, Tensor> arrays;
};

/// Makes the next step of this trainer. Throws as Trainer::train_step(), and std::invalid_argument when it
/// trains in several processes. `keep`: the arrays of the operators whose name begins so are kept; empty:
/// none are.
OpenedStep open_step(Trainer& trainer, const std::optional<std::string>& keep = {});

/// The first operator in which two openings of the same step differ.
struct OperatorDifference {
  std::string name, op;
  /// "output 0", "input 1" where an input differs that no operator made, "the settings".
  std::string what;
  std::string one, other;  ///< SHA-256 and shape of the arrays, or the settings
};
/// Empty when all is the same. Throws std::invalid_argument when they have other operators: of another
/// network.
std::optional<OperatorDifference> first_difference(const nlohmann::ordered_json& one,
                                                   const nlohmann::ordered_json& other);

}  // namespace supertac
