// A step of a training, opened: every operator that ran, forward and in reverse, with the SHA-256 of all that
// went into it and came out, from the state before the step to the state behind it. So two trainings that
// should be the same can be compared down to the operator where they part (examples/verify_ledger.py), and a
// single operator can be computed again (examples/referee.py).
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

}  // namespace supertac
