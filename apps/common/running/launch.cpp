#include "apps/common/running/launch.h"

#include <omp.h>

#include <algorithm>
#include <cstdlib>
#include <thread>

#include "apps/common/command_line/arguments.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

int number_in(const char* variable, int otherwise) {
  const char* text = std::getenv(variable);
  const auto value = text == nullptr ? std::nullopt : parse_int(text);
  return value && *value >= 0 && *value < (1 << 30) ? static_cast<int>(*value) : otherwise;
}

}  // namespace

Launch launch() {
  if (std::getenv("OMPI_COMM_WORLD_SIZE") != nullptr)
    return {number_in("OMPI_COMM_WORLD_RANK", 0), number_in("OMPI_COMM_WORLD_SIZE", 1),
            number_in("OMPI_COMM_WORLD_LOCAL_SIZE", 1), Launch::By::open_mpi};
  if (std::getenv("PMIX_RANK") != nullptr)  // srun --mpi=pmix
    return {number_in("PMIX_RANK", 0), number_in("SLURM_STEP_NUM_TASKS", 0), 1, Launch::By::open_mpi};
  if (std::getenv("PMI_SIZE") != nullptr)
    return {number_in("PMI_RANK", 0), number_in("PMI_SIZE", 1), number_in("MPI_LOCALNRANKS", 1),
            Launch::By::mpich};
  return {};
}

void join_launch(Arguments& a) {
  const Launch l = launch();
  if (l.rank > 0) a.mute();
  const int all = static_cast<int>(std::thread::hardware_concurrency());
  if (l.here <= 1 || a.given("threads") || std::getenv("OMP_NUM_THREADS") != nullptr || a.threads() < all)
    return;
  omp_set_num_threads(std::max(1, a.threads() / l.here));
}

}  // namespace supertac
