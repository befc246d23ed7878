#include "apps/common/running/progress.h"

#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <string_view>

#include "apps/common/command_line/arguments.h"
#include "apps/common/running/signals.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

std::string clock_text(double seconds) {
  const auto whole = static_cast<std::int64_t>(std::lround(std::min(seconds, 1e6)));
  const auto two = [](std::int64_t number) { return (number < 10 ? "0" : "") + std::to_string(number); };
  if (whole < 3600) return std::to_string(whole / 60) + ":" + two(whole % 60);
  return std::to_string(whole / 3600) + ":" + two(whole / 60 % 60) + ":" + two(whole % 60);
}

}  // namespace

bool drawable_terminal() {
  const char* terminal = std::getenv("TERM");
  return isatty(STDERR_FILENO) == 1 && terminal != nullptr && std::string_view(terminal) != "dumb";
}

TerminalLine::~TerminalLine() {
  left_ += "\r" + std::string(width_, ' ') + "\r";
  (void)send_left();
}

// A terminal that takes nothing (Ctrl-S, a stuck connection) is left alone, with what it has not taken.
void TerminalLine::show(std::string line) {
  if (!send_left()) return;
  winsize size{};
  const bool known = ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 1;
  line.resize(std::min<std::size_t>(line.size(), (known ? size.ws_col : 80) - 1));
  const std::size_t width = line.size();
  if (width_ > width) line.append(width_ - width, ' ');
  width_ = width;
  left_ = "\r" + line;
  (void)send_left();
}

// Byte by byte while it takes them: O_NONBLOCK would change it for the shell and everybody else who shares
// it.
bool TerminalLine::send_left() {
  while (!left_.empty()) {
    pollfd takes{STDERR_FILENO, POLLOUT, 0};
    if (::poll(&takes, 1, 0) != 1) return false;
    const ssize_t count = ::write(STDERR_FILENO, left_.data(), 1);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0 && errno != EAGAIN) left_.clear();  // the terminal is gone
    if (count <= 0) return false;
    left_.erase(0, 1);
  }
  return true;
}

Progress::Progress(const Arguments& arguments, std::string what, std::uint64_t total, std::string unit,
                   std::uint64_t before)
    : what_(std::move(what)),
      unit_(std::move(unit)),
      total_(total),
      before_(before),
      drawable_(!arguments.quiet() && drawable_terminal()),
      begin_(std::chrono::steady_clock::now()),
      last_(begin_) {}

void Progress::update(std::uint64_t done, const std::string& detail, double seconds_left) {
  using namespace std::chrono_literals;
  const auto now = std::chrono::steady_clock::now();
  if (!drawable_ || now - begin_ < 2s || now - last_ < 200ms || (done <= before_ && seconds_left <= 0))
    return;
  last_ = now;
  const double seconds = std::chrono::duration<double>(now - begin_).count();
  const double rate = seconds_left > 0 ? static_cast<double>(total_ - done) / seconds_left
                                       : static_cast<double>(done - before_) / seconds;
  if (!line_) line_ = std::make_unique<TerminalLine>();
  line_->show(progress_line(what_, done, total_, unit_, rate, detail));
}

std::function<void(std::size_t, std::size_t)> progress_of(const Arguments& arguments, const std::string& what,
                                                          const std::string& unit) {
  return
      [&arguments, what, unit, bar = std::shared_ptr<Progress>()](std::size_t done, std::size_t all) mutable {
        stop_if_interrupted();
        if (!bar || done == 0) bar = std::make_shared<Progress>(arguments, what, all, unit);
        bar->update(done);
      };
}

std::string progress_line(const std::string& what, std::uint64_t done, std::uint64_t total,
                          const std::string& unit, double rate, const std::string& detail) {
  const int width = detail.empty() ? 24 : 10;
  const double share =
      total > 0 ? std::min(1.0, static_cast<double>(done) / static_cast<double>(total)) : 0.0;
  const int cells = static_cast<int>(share * width);
  const std::string rate_text = format(rate, rate < 10 ? 1 : 0) + " " + unit + "/s";
  std::string line = what + "  [" + std::string(cells, '#') + std::string(width - cells, '.') + "]  " +
                     format(100 * share, 0) + " %  " + (detail.empty() ? rate_text : detail);
  if (rate > 0 && total >= done)
    line += "  " + clock_text(static_cast<double>(total - done) / rate) + " left";
  return line;
}

}  // namespace supertac
