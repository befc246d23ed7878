#include "apps/stream/views/terminal_view.h"

#include <fcntl.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <span>

#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr int kSide = 32;  // pixels of either picture on the terminal
constexpr std::string_view kGap = "   ";
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
struct Raster {
  std::span<const float> values;
  int height, width, lines, columns;
};

// The longer side of the array gets kSide pixels of the terminal, the other its share, an even number.
Raster raster_of(std::span<const float> values, const TaxelArray& array, int scale) {
  const int longer = std::max(array.rows, array.columns);
  return {values, array.rows * scale, array.columns * scale, std::max(2, kSide * array.rows / longer / 2 * 2),
          std::max(1, kSide * array.columns / longer)};
}

// Row 0 is on top: that is the largest y.
float pixel(const Raster& raster, int row, int column) {
  if (raster.values.empty()) return 0;
  const int r = raster.height - 1 - row * raster.height / raster.lines;
  return raster.values[static_cast<std::size_t>(r * raster.width + column * raster.width / raster.columns)];
}

void append_row(std::string& text, const Raster& picture, int line, bool colour) {
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

std::string padded(std::string text, int columns) {
  text.resize(static_cast<std::size_t>(columns), ' ');
  return text;
}

// 0 [a step of each colour] 1
std::string scale_line(bool colour, int columns, const std::string& meaning) {
  std::string text = "0 ";
  if (colour) {
    for (const int code : kHeat) text += "\x1b[48;5;" + std::to_string(code) + "m ";
    text += "\x1b[0m";
  } else {
    text += kInk;
  }
  text += " 1";
  const bool room = columns == 0 || columns > kSide + 24;
  return text + (room ? "  " + meaning : "") + "\n";
}

std::string heading(const char* name, const TaxelArray& array, int scale) {
  const ImageGrid grid = array.picture(scale);
  return std::string(name) + ", " + format(grid.width_mm()) + " x " + format(grid.height_mm()) + " mm";
}

bool colour_wanted() {
  const char* no_color = std::getenv("NO_COLOR");
  return no_color == nullptr || *no_color == '\0';
}

TerminalSize terminal_size() {
  winsize size{};
  return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 ? TerminalSize{size.ws_col, size.ws_row}
                                                      : TerminalSize{};
}

}  // namespace

std::string status_line(const LiveState& state, int columns) {
  std::string line =
      format(state.frames_per_s, 0) + " frames/s  latency " + format(state.median_ms, 2) + " ms (p99 " +
      format(state.p99_ms, 2) + ")  lost " + std::to_string(state.lost) + "  dropped " +
      std::to_string(state.dropped) +
      (state.uncertainty() > 0 ? "  +-" + format(state.uncertainty(), 2) : "") +
      (std::isfinite(state.x_mm) ? "  at x " + format(static_cast<double>(state.x_mm), 1) + " y " +
                                       format(static_cast<double>(state.y_mm), 1) + " mm"
                                 : "");
  // Never cut.
  if (state.unlike_training) line = "UNLIKE TRAINING  " + line;
  if (columns > 0) line = line.substr(0, static_cast<std::size_t>(columns));
  return line + "\n";
}

std::string render(const LiveState& state, bool colour, const TerminalSize& size) {
  const Raster felt = raster_of(state.taxels, state.array, 1);
  const Raster seen = raster_of(state.picture, state.array, state.scale);
  const auto fits = [&](int columns, int lines) {
    return (size.columns == 0 || size.columns >= columns) && (size.lines == 0 || size.lines > lines);
  };
  const int lines = seen.lines / 2 + 3, gap = static_cast<int>(kGap.size());
  const bool raw = !state.draws, one = fits(seen.columns, lines);
  const bool both = !raw && fits(felt.columns + gap + seen.columns, lines);
  if (!one) {
    const std::string note = "too small a window for pictures\n";
    return (fits(static_cast<int>(note.size()), 2) ? note : "") + status_line(state, size.columns);
  }
  std::string text;
  if (both) text += padded(heading("felt", state.array, 1), felt.columns) + std::string(kGap);
  text += raw ? heading("felt", state.array, 1) : heading("drawn", state.array, state.scale);
  text += '\n';
  for (int line = 0; line < seen.lines / 2; ++line) {
    if (both) {
      append_row(text, felt, line, colour);
      text += kGap;
    }
    append_row(text, raw ? felt : seen, line, colour);
    text += '\n';
  }
  const std::string of_felt = format(state.top, 4) + " " + state.unit + " from rest";
  const std::string meaning = raw    ? "1 is " + of_felt
                              : both ? "felt: " + of_felt + "; drawn: the highest"
                                     : "the highest";
  return text + scale_line(colour, size.columns, meaning) + status_line(state, size.columns);
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
  std::string text = render(state, colour_, terminal_size());
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
