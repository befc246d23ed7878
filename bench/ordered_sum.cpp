// What the ordered sum of gradients costs beside MPI_Allreduce, in turns: mpirun -n 2 ordered_sum [VALUES
// [TURNS]].
#include <mpi.h>

#include <chrono>
#include <cstdio>
#include <string>
#include <vector>

#include "apps/common/running/launch.h"
#include "apps/ranks/mpi_ranks.h"
#include "io/numbers/median.h"

namespace {

// Until all have it: what is still on its way when the first has it delays the next step.
template <class Work>
double milliseconds(const Work& work) {
  MPI_Barrier(MPI_COMM_WORLD);
  const auto begin = std::chrono::steady_clock::now();
  work();
  MPI_Barrier(MPI_COMM_WORLD);
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
}

}  // namespace

int main(int argc, char** argv) {
  const std::size_t count = argc > 1 ? std::stoul(argv[1]) : 537'521;  // parameters of preset paper
  const int turns = argc > 2 ? std::stoi(argv[2]) : 200;
  const supertac::EndWatch watch;
  supertac::MpiRanks ranks(supertac::launch().rank, 60);
  std::vector<float> values(count, 1e-30F), buffer(count);
  std::vector<double> ordered, reduced, exchanged;
  std::byte byte{}, theirs{};
  for (int turn = 0; turn < turns; ++turn) {
    ordered.push_back(milliseconds([&] { ranks.add_up(values, buffer); }));
    reduced.push_back(milliseconds([&] {
      MPI_Allreduce(MPI_IN_PLACE, values.data(), static_cast<int>(count), MPI_FLOAT, MPI_SUM, MPI_COMM_WORLD);
    }));
    exchanged.push_back(milliseconds([&] { ranks.exchange(ranks.rank() ^ 1, {&byte, 1}, {&theirs, 1}); }));
    values.assign(count, 1e-30F);
  }
  if (ranks.first()) {
    using supertac::quantile;
    std::printf(
        "ranks,values,turns,ordered_ms,allreduce_ms,byte_ms,ordered_q10_ms,allreduce_q10_ms,byte_q10_ms\n");
    std::printf("%d,%zu,%d,%.3f,%.3f,%.4f,%.3f,%.3f,%.4f\n", ranks.size(), count, turns,
                quantile(ordered, 0.5), quantile(reduced, 0.5), quantile(exchanged, 0.5),
                quantile(ordered, 0.1), quantile(reduced, 0.1), quantile(exchanged, 0.1));
  }
  ranks.finish(watch);
}
