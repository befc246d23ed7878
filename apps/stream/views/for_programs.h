// Pictures for other programs: a line of JSON each, or a file for the tools of robotics.
#pragma once

#include <unistd.h>

#include <cstdint>
#include <deque>
#include <string>

#include "apps/stream/live_frame.h"
#include "data/sensors/sensor.h"
#include "io/files/mcap_file.h"

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

/// Frames and pictures as messages of ROS 2 in an MCAP file:
///   /supertac/taxels      std_msgs/msg/Float32MultiArray [rows][columns][channels], in the sensor's unit
///   /supertac/total_force std_msgs/msg/Float32, and
///   /supertac/saturated   std_msgs/msg/UInt32, as FrameLoad has them
///   /supertac/picture     sensor_msgs/msg/Image, 32FC1 [height][width]; without pictures the array itself,
///                         32FC<channels> [rows][columns]
///   /supertac/half_widths the same, of each pixel's 90 % interval, where the model says how sure it is
/// Pictures are stamped, and all messages logged, with the wall-clock time of the frame, and
/// published with the sensor's. Metadata of a channel name the unit, the array, and the size of a pixel in
/// mm.
class McapLog {
 public:
  /// `image` without pixels: there are no pictures. `half_widths`: whether add() gets any. Throws FileError.
  McapLog(const OutputPath& output, const TaxelArray& array, const SignalScale& scale, const ImageGrid& image,
          bool half_widths);
  /// Where the wall-clock time is not known the sensor's stands for it. Throws FileError.
  void add(const LiveFrame& seen);
  /// Throws FileError, again when add() has.
  void close() { file_.close(); }

 private:
  TaxelArray array_;
  SignalScale scale_;
  ImageGrid image_;
  McapFile file_;
};

}  // namespace supertac
