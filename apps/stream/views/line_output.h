// Pictures for other programs, one line of JSON each.
#pragma once

#include <condition_variable>
#include <deque>
#include <mutex>
#include <string>
#include <thread>

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

/// Writes lines to a pipe from a thread of its own. At most kWaiting lines wait for a reader that is slow;
/// more are lost.
class PipeOutput {
 public:
  static constexpr std::size_t kWaiting = 2048;

  /// Of a descriptor that stays open. `patient`: nothing is lost, send() waits for the reader instead, until
  /// a signal comes: for what was recorded before.
  PipeOutput(int file, bool patient);
  /// Gives the reader a second to take what waits.
  ~PipeOutput();
  PipeOutput(const PipeOutput&) = delete;
  PipeOutput& operator=(const PipeOutput&) = delete;
  /// Throws std::runtime_error once the reader is gone.
  void send(std::string line);
  std::uint64_t lost() const { return lost_; }

 private:
  void run();
  bool write_all(const std::string& text);

  int file_;
  bool patient_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::string> waiting_;
  bool stop_ = false, gone_ = false;
  double stopped_s_ = 0;
  std::uint64_t lost_ = 0;
  std::thread thread_;
};

}  // namespace supertac
