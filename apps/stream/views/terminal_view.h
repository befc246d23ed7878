// The live picture on a terminal: what the array feels and what the network makes of it, side by side.
#pragma once

#include <atomic>
#include <mutex>
#include <string>
#include <thread>

#include "apps/stream/live_state.h"

namespace supertac {

/// Size of a terminal in characters; 0 where it does not say.
struct TerminalSize {
  int columns = 0, lines = 0;
};

/// A line of headings with mm; two pictures of 32 columns and 16 lines, or less for the shorter side of the
/// array, y upwards; a line with the scale, and status_line(). Every line ends with a line feed. Where both
/// do not fit, the drawn picture alone; where that does not, a line that says so and the figures. `colour`:
/// half blocks in 256 colours, two pixels a character; without, characters from blank to @.
std::string render(const LiveState& state, bool colour, const TerminalSize& size = {});
/// The line of figures alone, and where the finger is, cut to so many columns (0: not cut).
std::string status_line(const LiveState& state, int columns = 0);

/// Draws the newest state on stderr 15 times a second, on a thread of its own: a slow terminal holds up
/// nobody.
class TerminalView {
 public:
  TerminalView();
  /// Draws a last time.
  ~TerminalView();
  TerminalView(const TerminalView&) = delete;
  TerminalView& operator=(const TerminalView&) = delete;

  void update(const LiveState& state);

 private:
  void run();
  void draw(const LiveState& state);
  /// False when the terminal has not taken everything yet.
  bool send_left();

  bool colour_;
  int terminal_ = -1;
  std::string left_;  // not yet taken
  int drawn_lines_ = 0;
  std::mutex mutex_;
  LiveState newest_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace supertac
