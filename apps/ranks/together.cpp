#include "apps/ranks/together.h"

#include <chrono>
#include <thread>

#include "apps/common/command_line/program.h"
#include "apps/common/running/launch.h"
#include "apps/common/running/signals.h"
#include "apps/ranks/mpi_ranks.h"

namespace supertac {
namespace {

void check_mpi(const Launch& l) {
  if (l.by != built_with())
    throw UsageError("built with " + mpi_version() +
                     ", but started by the mpirun of another MPI; use mpirun" +
                     (built_with() == Launch::By::mpich ? ".mpich or mpiexec.hydra" : ".openmpi") +
                     ", or build with the other one's -DMPI_CXX_COMPILER");
}

}  // namespace

void declare_together(Arguments& a) {
  a.more().option("deadline", "S", "under mpirun: give up a process that has not answered for S seconds",
                  "20");
  a.decides_nothing();
}

int together(Arguments& a, const std::function<int(Ranks&)>& work) {
  const Launch l = launch();
  if (l.size == 1) return work(one_process());
  check_mpi(l);
  const EndWatch watch;
  MpiRanks ranks(l.rank, a.number("deadline", 1, 1e6));
  join_launch(a);
  try {
    const int code = work(ranks);
    ranks.finish(watch);
    return code;
  } catch (const RankLeft&) {
    std::this_thread::sleep_for(
        std::chrono::seconds(1));  // it reports; mpirun ends all when the first is gone
    return kExitFailed;
  } catch (const Interrupted&) {
    ranks.leave("stopped by a signal");
    throw;
  } catch (const std::bad_alloc&) {
    ranks.leave("out of memory");
    throw;
  } catch (const std::exception& error) {
    if (ranks.leave(error.what())) throw;
    std::this_thread::sleep_for(std::chrono::seconds(1));
    return kExitFailed;
  }
}

}  // namespace supertac
