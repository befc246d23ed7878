// How a program shows on a terminal what it is doing and how far it is.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

namespace supertac {

class Arguments;

/// Whether stderr is a terminal that can be drawn on (not TERM=dumb).
bool drawable_terminal();

/// A line of stderr, which is such a terminal: shown anew each time, cut to its width, and wiped at the end.
/// It needs no colour and no escape codes, and a terminal that is slow or not read holds up nobody.
class TerminalLine {
 public:
  TerminalLine() = default;
  ~TerminalLine();
  TerminalLine(const TerminalLine&) = delete;
  TerminalLine& operator=(const TerminalLine&) = delete;
  void show(std::string line);

 private:
  /// False when the terminal has not taken everything yet.
  bool send_left();

  std::string left_;       // not yet taken
  std::size_t width_ = 0;  // of what is drawn
};

/// How far a long work is: on a terminal (not TERM=dumb), and not under --quiet, a bar on stderr shows share
/// done, rate and time left, once the work has taken two seconds. Not to be shared by threads.
class Progress {
 public:
  /// `unit`: what is counted, in the plural ("passes", "steps"). `before`: how many of `total` were done
  /// earlier, by the run that is resumed.
  Progress(const Arguments& arguments, std::string what, std::uint64_t total, std::string unit,
           std::uint64_t before = 0);

  /// `done` of `total` so far; `detail` is shown in place of the rate. `seconds_left`: where the caller knows
  /// better than by the rate. Cheap: draws at most five times a second.
  void update(std::uint64_t done, const std::string& detail = "", double seconds_left = 0);

 private:
  std::string what_, unit_;
  std::uint64_t total_, before_;
  bool drawable_;
  std::unique_ptr<TerminalLine> line_;  // once something is drawn
  std::chrono::steady_clock::time_point begin_, last_;
};

/// To be called for each part of long work that knows nothing of programs: shows how far `what` is, in
/// `unit`, from the beginning again where `done` is 0, and ends it by Interrupted after a signal.
std::function<void(std::size_t done, std::size_t all)> progress_of(const Arguments& arguments,
                                                                   const std::string& what,
                                                                   const std::string& unit);

/// The bar's text, e.g. "training  [#####.....]  50 %  1200 steps/s  0:41 left"; `rate` is in units a second,
/// `detail` replaces it.
std::string progress_line(const std::string& what, std::uint64_t done, std::uint64_t total,
                          const std::string& unit, double rate, const std::string& detail = "");

}  // namespace supertac
