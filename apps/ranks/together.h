// The processes of one mpirun.
#pragma once

#include <functional>

#include "apps/common/command_line/arguments.h"
#include "models/training/ranks.h"

namespace supertac {

/// Does `work` as one of the processes that mpirun or srun started, or as one_process(). Only the first rank
/// talks. MPI ends all processes when one ends with an error, which it reports, or is lost. Returns what
/// `work` returned. Throws UsageError when the build has no MPI.
int together(Arguments& a, const std::function<int(Ranks&)>& work);

}  // namespace supertac
