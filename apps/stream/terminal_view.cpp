#include "apps/stream/terminal_view.h"

#include <fcntl.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <span>

#include "io/numbers.h"

namespace supertac {
namespace {

constexpr int kSide = 32;              // pixels of either picture on the terminal
constexpr int kLines = kSide / 2 + 1;  // two pixels a line, and the figures
constexpr int kColumns = 2 * kSide + 3;
constexpr auto kDrawEvery = std::chrono::milliseconds(66);

// Of the 256 colours every terminal has: black, violet, red, orange, yellow, white, ever brighter.
constexpr std::array<int, 16> kHeat = {16,  17,  54,  90,  126, 161, 197, 203,
                                       208, 214, 220, 226, 227, 228, 230, 231};
constexpr std::string_view kInk = " .:-=+*#%@";

// NaN is level 0.
template <std::size_t N>
std::size_t level(float value) {
  return static_cast<std::size_t>((value > 0 ? std::min(value, 1.0F) : 0.0F) * (N - 1) + 0.5F);
}

// An image of height x width pixels that is drawn `lines` x `columns`.
struct Drawing {
  std::span<const float> values;
  int height, width, lines, columns;
};

// The longer side of the array gets kSide pixels of the terminal, the other its share, an even number.
Drawing drawing_of(std::span<const float> values, const TaxelArray& array, int scale) {
  const int longer = std::max(array.rows, array.columns);
  return {values, array.rows * scale, array.columns * scale, kSide * array.rows / longer / 2 * 2,
          kSide * array.columns / longer};
}

// Row 0 is on top: that is the largest y.
float pixel(const Drawing& drawing, int row, int column) {
  if (drawing.values.empty()) return 0;
  const int r = drawing.height - 1 - row * drawing.height / drawing.lines;
  return drawing
      .values[static_cast<std::size_t>(r * drawing.width + column * drawing.width / drawing.columns)];
}

void append_row(std::string& text, const Drawing& picture, int line, bool colour) {
  std::size_t above_before = kHeat.size(), below_before = kHeat.size();
  for (int column = 0; column < picture.columns; ++column) {
    const float above = pixel(picture, 2 * line, column), below = pixel(picture, 2 * line + 1, column);
    if (!colour) {
      text += kInk[level<kInk.size()>(0.5F * (above + below))];
      continue;
    }
    const std::size_t top = level<kHeat.size()>(above), bottom = level<kHeat.size()>(below);
    if (top != above_before) text += "\x1b[38;5;" + std::to_string(kHeat[top]) + "m";
    if (bottom != below_before) text += "\x1b[48;5;" + std::to_string(kHeat[bottom]) + "m";
    text += "\u2580";  // upper half block
    above_before = top, below_before = bottom;
  }
  if (colour) text += "\x1b[0m";
}

bool colour_wanted() {
  const char* no_color = std::getenv("NO_COLOR");
  return no_color == nullptr || *no_color == '\0';
}

// A terminal that does not know its size says 0.
bool window_is_large_enough() {
  winsize size{};
  if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) != 0) return true;
  return (size.ws_col == 0 || size.ws_col >= kColumns) && (size.ws_row == 0 || size.ws_row > kLines);
}

}  // namespace

std::string status_line(const LiveState& state) {
  return format(state.frames_per_s, 0) + " frames/s  latency " + format(state.median_ms, 2) + " ms (p99 " +
         format(state.p99_ms, 2) + ")  lost " + std::to_string(state.lost) + "  dropped " +
         std::to_string(state.dropped) + (state.doubt() > 0 ? "  +-" + format(state.doubt(), 2) : "") +
         (state.unlike_training ? "  UNLIKE TRAINING" : "") + "\n";
}

std::string render(const LiveState& state, bool colour) {
  std::string text;
  const Drawing felt = drawing_of(state.taxels, state.array, 1);
  const Drawing seen = drawing_of(state.picture, state.array, state.scale);
  for (int line = 0; line < felt.lines / 2; ++line) {
    append_row(text, felt, line, colour);
    text += "   ";
    append_row(text, seen, line, colour);
    text += '\n';
  }
  return text + status_line(state);
}

// Opened anew: O_NONBLOCK on stderr itself would change it for the shell and everybody else who shares it.
TerminalView::TerminalView()
    : colour_(colour_wanted()),
      terminal_(::open("/proc/self/fd/2", O_WRONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC)),
      thread_([this] { run(); }) {}

TerminalView::~TerminalView() {
  stop_ = true;
  thread_.join();
  if (terminal_ >= 0) ::close(terminal_);
}

void TerminalView::update(const LiveState& state) {
  std::lock_guard lock(mutex_);
  newest_ = state;
}

void TerminalView::run() {
  for (bool last = false; !last;) {
    std::this_thread::sleep_for(kDrawEvery);
    last = stop_;
    LiveState state;
    {
      std::lock_guard lock(mutex_);
      state = newest_;
    }
    draw(state);
  }
}

// A terminal that takes nothing (Ctrl-S, a stuck connection) is left alone, with what it has not taken: the
// end of the program must not wait for it. Poll says that there is room, not how much; TerminalView's own
// descriptor does not block.
void TerminalView::draw(const LiveState& state) {
  if (!send_left()) return;
  std::string text = window_is_large_enough() ? render(state, colour_) : status_line(state);
  if (drawn_lines_ > 0) text = "\x1b[" + std::to_string(drawn_lines_) + "A\x1b[J" + text;
  drawn_lines_ = static_cast<int>(std::count(text.begin(), text.end(), '\n'));
  left_ = std::move(text);
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
