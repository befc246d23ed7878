#pragma once

#include "apps/common/command_line/arguments.h"

namespace supertac {

/// `supertac-check training`: repeats pieces of a training from its kept states and compares every line of
/// its ledger, all arrays of the state and the batches. Returns the exit code. Throws as supertac-train does.
int check_training(const Arguments& a);

/// `supertac-check ledgers`: the first step and array in which two ledgers differ.
int check_ledgers(const Arguments& a);

}  // namespace supertac
