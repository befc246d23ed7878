#include "apps/stream/views/terminal_view.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>

#include "apps/common/running/progress.h"
#include "io/numbers/numbers.h"

namespace supertac {

std::string status_line(const LiveState& state, int columns) {
  std::string line =
      format(state.frames_per_s, 0) + " frames/s  latency " + format(state.median_ms, 2) + " ms (p99 " +
      format(state.p99_ms, 2) + ")  lost " + std::to_string(state.lost) + "  dropped " +
      std::to_string(state.dropped) +
      (state.uncertainty() > 0 ? "  +-" + format(state.uncertainty(), 2) : "") +
      (std::isfinite(state.x_mm) ? "  at x " + format(static_cast<double>(state.x_mm), 1) + " y " +
                                       format(static_cast<double>(state.y_mm), 1) + " mm"
                                 : "");
  if (state.unlike_training) line = "UNLIKE TRAINING  " + line;  // in front: never cut
  return columns > 0 ? line.substr(0, static_cast<std::size_t>(columns)) : line;
}

// Opened anew: O_NONBLOCK on stderr itself would change it for the shell and everybody else who shares it.
TerminalView::TerminalView()
    : terminal_(::open("/proc/self/fd/2", O_WRONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC)) {}

TerminalView::~TerminalView() {
  left_ += "\n";
  (void)send_left();
  if (terminal_ >= 0) ::close(terminal_);
}

// A terminal that takes nothing (Ctrl-S, a stuck connection) is left alone, with what it has not taken.
void TerminalView::update(const LiveState& state) {
  if (!send_left()) return;
  left_ = "\r" + status_line(state, static_cast<int>(terminal_width()) - 1) + "\x1b[K";
  (void)send_left();
}

bool TerminalView::send_left() {
  while (!left_.empty()) {
    const ssize_t count = ::write(terminal_, left_.data(), left_.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0 && errno != EAGAIN) left_.clear();  // the terminal is gone
    if (count <= 0) return false;
    left_.erase(0, static_cast<std::size_t>(count));
  }
  return true;
}

}  // namespace supertac
