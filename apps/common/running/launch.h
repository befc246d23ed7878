#pragma once

namespace supertac {

class Arguments;

/// How mpirun or srun started this process, read from the variables that they set; nothing is asked of MPI.
struct Launch {
  int rank = 0, size = 1;  ///< size 0: several processes, their number is not said
  int here = 1;            ///< of them on this machine, as far as it is said
  enum class By { nobody, open_mpi, mpich } by = By::nobody;
};
Launch launch();

/// Makes this program one of those that were started together: all but the first are mute, and where nobody
/// bound them to processors of their own they share the machine's.
void join_launch(Arguments& a);

}  // namespace supertac
