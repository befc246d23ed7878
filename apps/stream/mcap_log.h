// A stream as a file for the tools of robotics.
#pragma once

#include <string>

#include "apps/stream/live_frame.h"
#include "data/sensors/sensor.h"
#include "io/files/mcap_file.h"

namespace supertac {

/// Frames and pictures as messages of ROS 2 in an MCAP file:
///   /supertac/taxels      std_msgs/msg/Float32MultiArray [rows][columns][channels], in the sensor's unit
///   /supertac/total_force std_msgs/msg/Float32, and
///   /supertac/saturated   std_msgs/msg/UInt32, as FrameLoad has them
///   /supertac/picture     sensor_msgs/msg/Image, 32FC1 [height][width]; without pictures the array itself,
///                         32FC<channels> [rows][columns]
///   /supertac/half_width  the same, of each pixel's 90 % interval, where the model says how sure it is
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
