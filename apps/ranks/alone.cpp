// together() of a build without MPI.
#include "apps/common/running/launch.h"
#include "apps/ranks/together.h"

namespace supertac {

void declare_together(Arguments&) {}

int together(Arguments&, const std::function<int(Ranks&)>& work) {
  if (launch().size != 1)
    throw UsageError(
        "started as one of several processes, but this build has no MPI and each would work alone; build "
        "with -DSUPERTAC_MPI=ON, or start one process");
  return work(one_process());
}

}  // namespace supertac
