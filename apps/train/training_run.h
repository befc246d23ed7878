// One model trained into a file.
#pragma once

#include "apps/common/command_line/arguments.h"
#include "models/training/ranks.h"

namespace supertac {

/// Trains as --data, --out, --resume and the options of declare_training() say; only the first of `ranks`
/// writes. Returns the exit code. Throws as window_task(), Trainer and RunFolder; RanksError when ranks have
/// other data or options.
int train(const Arguments& a, Ranks& ranks);

}  // namespace supertac
