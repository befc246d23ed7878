#pragma once

#include "apps/common/command_line/arguments.h"

namespace supertac {

// Each returns the exit code, and throws as supertac-train does.

/// `supertac-check training`: repeats pieces of a training from its kept states and compares every line of
/// its ledger, all arrays of the state and the batches.
int check_training(const Arguments& a);

/// `supertac-check step`: repeats a training up to one step and opens it
/// (models/training/audit/opened_step.h).
int check_step(const Arguments& a);

/// `supertac-check ledgers`: the first step and array in which two ledgers differ and, with the recordings,
/// the first operator and entry; or those of two opened steps.
int check_ledgers(const Arguments& a);

}  // namespace supertac
