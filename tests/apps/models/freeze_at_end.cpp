// Preloaded: the first rank of mpirun freezes when MPI has ended, behind the last word that others wait for.
#include <mpi.h>

#include <csignal>
#include <cstdlib>
#include <string_view>

extern "C" int MPI_Finalize() {
  const int result = PMPI_Finalize();
  for (const char* name : {"OMPI_COMM_WORLD_RANK", "PMI_RANK"}) {
    const char* rank = std::getenv(name);
    if (rank != nullptr && rank == std::string_view("0")) std::raise(SIGSTOP);
  }
  return result;
}
