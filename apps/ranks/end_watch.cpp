#include "apps/ranks/end_watch.h"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>

namespace supertac {
namespace {

constexpr double kMostS = 1e6;  // poll counts milliseconds in an int

// The other end of the pipe closes when the parent ends, however it does. Nothing else of the parent's is
// held open: mpirun sees by its sockets that a process has gone.
[[noreturn]] void watch(pid_t parent, int from_parent) {
  dup2(from_parent, STDIN_FILENO);
  close(STDOUT_FILENO);
  close_range(STDERR_FILENO + 1, ~0U, 0);
  double seconds = 0;
  if (read(STDIN_FILENO, &seconds, sizeof seconds) != sizeof seconds) _exit(0);
  pollfd closed{.fd = STDIN_FILENO, .events = 0, .revents = 0};
  if (poll(&closed, 1, static_cast<int>(1e3 * seconds)) != 0) _exit(0);
  static const char kText[] =
      "supertac: all is written, but a process of mpirun did not end within the deadline and was killed\n";
  (void)!write(STDERR_FILENO, kText, sizeof kText - 1);
  kill(parent, SIGKILL);
  _exit(1);
}

}  // namespace

EndWatch::EndWatch() {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) return;
  const pid_t parent = getpid(), child = fork();
  if (child == 0) watch(parent, ends[0]);
  close(ends[0]);
  to_child_ = ends[1];
  if (child > 0) return;
  close(to_child_);
  to_child_ = -1;
}

EndWatch::~EndWatch() {
  if (to_child_ >= 0) close(to_child_);
}

void EndWatch::end_within(double seconds) const {
  const double most = std::min(seconds, kMostS);
  if (to_child_ >= 0) (void)!write(to_child_, &most, sizeof most);
}

}  // namespace supertac
