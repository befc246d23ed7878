#pragma once

#include "apps/common/arguments.h"

namespace supertac {

/// supertac-train --pairs FILE: a frame model from pairs of images (data/pairs.h), with the run folder, log,
/// checkpoints and resume of every training. Throws UsageError for options that only recordings have.
int train_on_pairs(const Arguments& a);

}  // namespace supertac
