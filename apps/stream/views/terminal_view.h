// The figures of a live stream on a terminal; its pictures are on the page (--web).
#pragma once

#include <string>

#include "apps/stream/live_state.h"

namespace supertac {

/// Rate, latency, frames lost and dropped, how sure the model is and where the finger is, cut to so many
/// columns (0: not cut).
std::string status_line(const LiveState& state, int columns = 0);

/// Keeps one line of stderr as the newest state has it. A slow terminal holds up nobody.
class TerminalView {
 public:
  TerminalView();
  /// Ends the line.
  ~TerminalView();
  TerminalView(const TerminalView&) = delete;
  TerminalView& operator=(const TerminalView&) = delete;

  void update(const LiveState& state);

 private:
  /// False when the terminal has not taken everything yet.
  bool send_left();

  int terminal_;
  std::string left_;  // not yet taken
};

}  // namespace supertac
