// A process frozen between its last message and its end.
#pragma once

namespace supertac {

/// A child of this process that ends it when it takes too long to end. mpirun waits as long as it takes for a
/// process that is frozen (SIGSTOP, say) behind the last word that the others wait for, and nobody else is
/// left to end it. Made before MPI_Init, because a process that communicates had better not fork.
class EndWatch {
 public:
  /// Where there can be no child, nothing is watched.
  EndWatch();
  ~EndWatch();
  EndWatch(const EndWatch&) = delete;
  EndWatch& operator=(const EndWatch&) = delete;

  /// From now on this process has so many seconds. Later it is killed, and the child writes a line that says
  /// so.
  void end_within(double seconds) const;

 private:
  int to_child_ = -1;
};

}  // namespace supertac
