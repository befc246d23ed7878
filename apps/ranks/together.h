// The processes of one mpirun.
#pragma once

#include <functional>

#include "apps/common/command_line/arguments.h"
#include "models/training/ranks.h"

namespace supertac {

/// --deadline: how long a process waits for another.
void declare_together(Arguments& a);

/// Does `work` as one of the processes that mpirun started, or as one_process(). Only the first rank talks.
/// When one ends with an error, is killed or freezes, all others end within the deadline and a few seconds,
/// and one line says why. Returns what `work` returned, or the code of a failure that another rank reports.
/// Throws what `work` threw where this rank is to report it; UsageError when the build has no MPI, or
/// another one than the mpirun.
int together(Arguments& a, const std::function<int(Ranks&)>& work);

}  // namespace supertac
