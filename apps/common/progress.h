#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace supertac {

class Arguments;

/// Whether stderr is a terminal that can be drawn on (not TERM=dumb).
bool drawable_terminal();

/// A progress bar on stderr: share done, rate, time left. Drawn on a terminal only (not TERM=dumb, not
/// --quiet), and only once the work has taken two seconds. It needs no colour and no escape codes. Not to be
/// shared by threads.
class Progress {
 public:
  /// `unit`: what is counted, in the plural ("passes", "steps")
  Progress(const Arguments& arguments, std::string what, std::uint64_t total, std::string unit);
  /// Wipes the bar.
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// `done` of `total` so far; `detail` is shown in place of the rate. Cheap: draws at most five times a
  /// second, cut to the terminal's width.
  void update(std::uint64_t done, const std::string& detail = "");

 private:
  void draw(const std::string& line);

  std::string what_, unit_;
  std::uint64_t total_;
  bool enabled_;
  std::size_t width_ = 0;  // of what is drawn
  std::chrono::steady_clock::time_point begin_, last_;
};

/// The bar's text, e.g. "training  [#####.....]  50 %  1200 steps/s  0:41 left"; `detail` replaces the rate.
std::string progress_line(const std::string& what, std::uint64_t done, std::uint64_t total,
                          const std::string& unit, double seconds, const std::string& detail = "");

}  // namespace supertac
