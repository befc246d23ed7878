// Ranks over MPI. Every wait polls calls that do not block, until a deadline: nothing hangs.
#pragma once

#include <mpi.h>

#include <chrono>
#include <list>
#include <map>
#include <string>
#include <vector>

#include "apps/common/running/launch.h"
#include "apps/ranks/end_watch.h"
#include "models/training/ranks.h"

namespace supertac {

/// Another rank ended with an error of its own, which it reports itself.
class RankLeft : public RanksError {
 public:
  using RanksError::RanksError;
};

Launch::By built_with();
std::string mpi_version();  ///< "Open MPI 4.1.4"

class MpiRanks : public Ranks {
 public:
  /// MPI_Init; `rank` is what it will say. Ends the process with a line when not all processes come within
  /// the deadline. One object a process.
  MpiRanks(int rank, double deadline_s);

  /// Throws RanksError naming the ranks that do not answer; RankLeft. After a signal, which mpirun sends to
  /// all when one is lost, the partner is given no more than a few steps' time.
  void exchange(int partner, std::span<const std::byte> mine, std::span<std::byte> theirs) override;

  /// Tells the others that this rank ends with an error. Returns whether it is the one to report it: the
  /// lowest rank of those that end so.
  bool leave(const std::string& why);
  /// Waits for all, then MPI_Finalize, which `watch` limits. Throws as exchange().
  void finish(const EndWatch& watch);

 private:
  using Clock = std::chrono::steady_clock;
  void wait(std::vector<MPI_Request>& requests);
  void tell_all(const std::string& news);
  void hear();
  void hear_for(double seconds, bool (MpiRanks::*enough)() const);
  bool all_here() const;
  bool all_left() const;
  void roll_call();
  std::string missing() const;

  double deadline_s_;
  std::map<int, std::string> here_, left_;  // what other ranks said
  std::list<std::string> told_;             // MPI may still be sending it
  std::vector<MPI_Request> telling_;
  Clock::time_point last_ = Clock::now();  // when an exchange ended
  Clock::duration longest_pause_{0};       // between two exchanges
};

}  // namespace supertac
