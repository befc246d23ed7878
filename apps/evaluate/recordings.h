#pragma once

#include "apps/common/command_line/arguments.h"

namespace supertac {

/// supertac-evaluate --data DIR: scores of the network and the baselines on windows of recordings; pictures,
/// arrays and pairs of single frames where asked for.
int evaluate_on_recordings(const Arguments& a);

}  // namespace supertac
