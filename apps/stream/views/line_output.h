// Pictures for other programs, one line of JSON each.
#pragma once

#include <unistd.h>

#include <cstdint>
#include <deque>
#include <string>

#include "apps/stream/live_frame.h"
#include "data/sensors/sensor.h"

namespace supertac {

/// {"timestamp":s,"wall_s":s,"number":n,ABOUT,"total_force":f,"saturated":n,"volts":[...],"picture":[...]}
/// with the numbers of LiveFrame and its load, four decimals of what is felt and drawn, and a line feed;
/// without a model no "picture"; of one that says how sure it is also "half_width", the mean over the pixels,
/// "distance" and "unlike_training", 0 or 1. "wall_s" only where it is known. "volts" are "signals" of any
/// other unit (signals_tensor()).
std::string picture_line(const LiveFrame& seen, const FrameLoad& load, const SignalScale& scale,
                         bool unlike_training, const std::string& about);
/// What all lines of a stream have in common:
/// "height":16,"width":16,"pixel_mm":0.75,"rows":4,"columns":4,"channels":1,"pitch_mm":3,"unit":"V".
std::string about_lines(const TaxelArray& array, const std::string& unit, const ImageGrid& image);

/// Writes lines to a pipe and waits for nobody: what its reader does not take yet waits, at most kWaiting
/// lines; more are lost.
class PipeOutput {
 public:
  static constexpr std::size_t kWaiting = 2048;

  /// Of a descriptor that stays open. `patient`: nothing is lost, send() waits for the reader instead, until
  /// a signal comes: for what was recorded before.
  PipeOutput(int file, bool patient) : file_(file), patient_(patient), terminal_(isatty(file) == 1) {}
  /// Gives the reader a second to take what waits.
  ~PipeOutput();
  PipeOutput(const PipeOutput&) = delete;
  PipeOutput& operator=(const PipeOutput&) = delete;
  /// Throws std::runtime_error once the reader is gone.
  void send(std::string line);
  /// Hands over what the pipe has room for, or with `wait_ms` one piece, once it has within that time.
  void write_waiting(int wait_ms = 0);
  std::uint64_t lost() const { return lost_; }

 private:
  int file_;
  bool patient_, terminal_, gone_ = false;
  std::deque<std::string> waiting_;
  std::size_t written_ = 0;  // of the first of them
  std::uint64_t lost_ = 0;
};

}  // namespace supertac
