#pragma once

#include "apps/common/command_line/arguments.h"

namespace supertac {

/// supertac-evaluate --pairs FILE: scores of a frame model and the baselines on the test side of pairs, all
/// together and for every group.
int evaluate_on_pairs(const Arguments& a);

}  // namespace supertac
