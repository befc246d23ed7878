#include "apps/ranks/together.h"

#include <algorithm>
#include <cstdlib>

#ifdef SUPERTAC_WITH_MPI
#include <mpi.h>
#include <omp.h>

#include <chrono>
#include <iostream>
#include <thread>

#include "apps/common/command_line/program.h"
#include "apps/common/running/signals.h"
#endif

namespace supertac {
namespace {

// MPI is asked nothing by a process that is alone: its start takes a while.
bool is_one_of_several() {
  constexpr const char* kSetByLaunchers[] = {"OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_SIZE"};
  return std::ranges::any_of(kSetByLaunchers, [](const char* name) { return std::getenv(name) != nullptr; });
}

#ifdef SUPERTAC_WITH_MPI

int ask(int (*what)(MPI_Comm, int*), MPI_Comm of = MPI_COMM_WORLD) {
  int answer = 0;
  what(of, &answer);
  return answer;
}

class MpiRanks : public Ranks {
 public:
  MpiRanks() : Ranks(ask(MPI_Comm_rank), ask(MPI_Comm_size)) {}
  void exchange(int partner, std::span<const std::byte> mine, std::span<std::byte> theirs) override {
    MPI_Sendrecv(mine.data(), static_cast<int>(mine.size()), MPI_BYTE, partner, 0, theirs.data(),
                 static_cast<int>(theirs.size()), MPI_BYTE, partner, 0, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
  }
};

// Where nobody bound the processes to processors of their own, those of a machine share it.
void share_threads(const Arguments& a) {
  MPI_Comm here = MPI_COMM_NULL;
  MPI_Comm_split_type(MPI_COMM_WORLD, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &here);
  const int all = static_cast<int>(std::thread::hardware_concurrency()), ranks = ask(MPI_Comm_size, here);
  if (!a.given("threads") && std::getenv("OMP_NUM_THREADS") == nullptr && a.threads() >= all)
    omp_set_num_threads(std::max(1, a.threads() / ranks));
}

// The first rank's word comes first; where all have the same error MPI ends the others before theirs.
[[noreturn]] void abandon(const Arguments& a, const Ranks& ranks, const std::string& why, int code) {
  if (!ranks.first()) std::this_thread::sleep_for(std::chrono::seconds(5));
  std::cerr << a.program() + " (rank " + std::to_string(ranks.rank()) + "): " + why + "\n";
  MPI_Abort(MPI_COMM_WORLD, code);
  std::abort();
}

int as_rank(Arguments& a, const std::function<int(Ranks&)>& work) {
  int got = 0;
  MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &got);
  catch_signals();  // MPI has set handlers of its own
  MpiRanks ranks;
  if (!ranks.first()) a.mute();
  share_threads(a);
  try {
    const int code = work(ranks);
    MPI_Finalize();
    return code;
  } catch (const Interrupted&) {
    abandon(a, ranks, "stopped by signal " + std::to_string(interrupting_signal()),
            128 + interrupting_signal());
  } catch (const UsageError& error) {
    abandon(a, ranks, error.what(), kExitUsage);
  } catch (const std::exception& error) {
    abandon(a, ranks, error.what(), kExitFailed);
  }
}

#else

int as_rank(Arguments&, const std::function<int(Ranks&)>&) {
  throw UsageError(
      "started as one of several processes, but this build has no MPI and each would work alone; build "
      "with -DSUPERTAC_MPI=ON, or start one process");
}

#endif

}  // namespace

int together(Arguments& a, const std::function<int(Ranks&)>& work) {
  return is_one_of_several() ? as_rank(a, work) : work(one_process());
}

}  // namespace supertac
