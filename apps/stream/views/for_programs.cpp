#include "apps/stream/views/for_programs.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "apps/common/running/signals.h"
#include "data/recordings/recording.h"
#include "hardware/ports/serial_port.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr double kLastWaitS = 1;
constexpr int kWaitMs = 50;

// JSON has no word for what is not a number.
void append(std::string& line, double value, int decimals) {
  line += std::isfinite(value) ? format(value, decimals) : "null";
}

void append(std::string& line, const char* name, std::span<const float> values) {
  line += std::string(",\"") + name + "\":[";
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (i > 0) line += ',';
    append(line, static_cast<double>(values[i]), 4);
  }
  line += ']';
}

}  // namespace

std::string picture_line(const LiveFrame& seen, const FrameLoad& load, const SignalScale& scale,
                         bool unlike_training, const std::string& about) {
  std::string line = "{\"timestamp\":" + format(seen.time_s, 6);
  if (!std::isnan(seen.wall_s)) line += ",\"wall_s\":" + format(seen.wall_s, 6);
  line += ",\"number\":" + std::to_string(seen.number) + "," + about + ",\"total_force\":";
  append(line, load.total_force, 4);
  line += ",\"saturated\":" + std::to_string(load.saturated);
  append(line, signals_tensor(scale), seen.signals);
  if (!seen.picture.empty()) append(line, "picture", seen.picture);
  if (!seen.half_widths.empty()) {
    line += ",\"half_width\":";
    append(line, mean_of(seen.half_widths), 4);
  }
  if (seen.distance) {
    line += ",\"distance\":";
    append(line, *seen.distance, 4);
    line += std::string(",\"unlike_training\":") + (unlike_training ? "1" : "0");
  }
  return line + "}\n";
}

std::string about_lines(const TaxelArray& array, const std::string& unit, const ImageGrid& image) {
  nlohmann::ordered_json about;
  if (image.pixels() > 0)
    about = {{"height", image.height}, {"width", image.width}, {"pixel_mm", json_of(image.pixel_mm)}};
  about.update({{"rows", array.rows},
                {"columns", array.columns},
                {"channels", array.channels},
                {"pitch_mm", json_of(array.pitch_mm)},
                {"unit", unit}});
  const std::string text = about.dump();
  return text.substr(1, text.size() - 2);
}

PipeOutput::~PipeOutput() {
  for (const double end = monotonic_seconds() + kLastWaitS;
       !gone_ && !waiting_.empty() && monotonic_seconds() < end;)
    write_waiting(kWaitMs);
}

void PipeOutput::send(std::string line) {
  while (patient_ && !gone_ && waiting_.size() == kWaiting && !interrupted()) write_waiting(kWaitMs);
  if (waiting_.size() == kWaiting)
    ++lost_;
  else
    waiting_.push_back(std::move(line));
  write_waiting();
  if (gone_) throw std::runtime_error("stdout: nobody reads it any more");
}

// The descriptor is shared with other programs and may not be made non-blocking; a pipe that polls ready
// takes PIPE_BUF bytes, a terminal one. Who waits looks at clock and signals between two pieces.
void PipeOutput::write_waiting(int wait_ms) {
  const std::size_t at_once = terminal_ ? 1 : 4096;
  for (pollfd ready{file_, POLLOUT, 0}; !gone_ && !waiting_.empty() && poll(&ready, 1, wait_ms) > 0;) {
    const std::string_view rest = std::string_view(waiting_.front()).substr(written_);
    const ssize_t count = ::write(file_, rest.data(), std::min(at_once, rest.size()));
    gone_ = count < 0 && errno != EINTR && errno != EAGAIN;
    if (count > 0) written_ += static_cast<std::size_t>(count);
    if (written_ == waiting_.front().size()) waiting_.pop_front(), written_ = 0;
    if (wait_ms > 0) return;
  }
}

namespace {

// The definitions of ROS 2's common interfaces, without their comments.
constexpr char kImage[] = R"(std_msgs/Header header
uint32 height
uint32 width
string encoding
uint8 is_bigendian
uint32 step
uint8[] data
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
)";
constexpr char kArray[] = R"(std_msgs/MultiArrayLayout layout
float32[] data
================================================================================
MSG: std_msgs/MultiArrayLayout
std_msgs/MultiArrayDimension[] dim
uint32 data_offset
================================================================================
MSG: std_msgs/MultiArrayDimension
string label
uint32 size
uint32 stride
)";

// A message as ROS 2 sends it, little-endian: numbers of four bytes are aligned to four.
class Cdr {
 public:
  Cdr& number(std::size_t value) {
    const auto word = static_cast<std::uint32_t>(value);
    text_.resize((text_.size() + 3) / 4 * 4);
    text_.append(reinterpret_cast<const char*>(&word), sizeof word);
    return *this;
  }
  Cdr& byte(char value) {
    text_ += value;
    return *this;
  }
  Cdr& text(const std::string& value) {
    number(value.size() + 1);
    text_.append(value).push_back('\0');
    return *this;
  }
  // Of floats: a sequence of `count` elements, which may be their bytes.
  Cdr& sequence(std::span<const float> values, std::size_t count) {
    number(count);
    text_.append(reinterpret_cast<const char*>(values.data()), values.size_bytes());
    return *this;
  }
  const std::string& message() const { return text_; }

 private:
  std::string text_{"\0\1\0\0", 4};
};

std::uint64_t nanoseconds(double seconds) {
  return static_cast<std::uint64_t>(std::clamp(std::round(1e9 * seconds), 0.0, 9e18));
}

std::string image_message(std::uint64_t stamp, int height, int width, int channels,
                          std::span<const float> values) {
  constexpr std::uint64_t kSecond = 1'000'000'000;
  const std::string encoding = "32FC" + std::to_string(channels);
  const std::size_t step = values.size_bytes() / static_cast<std::size_t>(height);
  return Cdr()
      .number(stamp / kSecond)
      .number(stamp % kSecond)
      .text("supertac")  // the frame of coordinates
      .number(static_cast<std::size_t>(height))
      .number(static_cast<std::size_t>(width))
      .text(encoding)
      .byte(0)
      .number(step)
      .sequence(values, values.size_bytes())
      .message();
}

std::string taxels_message(const TaxelArray& array, std::span<const float> signals) {
  Cdr cdr;
  cdr.number(3);
  std::size_t stride = array.signals();
  const auto axis = [&](const char* label, int count) {
    const auto size = static_cast<std::size_t>(count);
    cdr.text(label).number(size).number(stride);
    stride /= size;
  };
  axis("rows", array.rows), axis("columns", array.columns), axis("channels", array.channels);
  return cdr.number(0).sequence(signals, signals.size()).message();
}

std::vector<McapChannel> channels_of(const TaxelArray& array, const std::string& unit, const ImageGrid& image,
                                     bool half_widths) {
  const bool drawn = image.pixels() > 0;
  const auto channel = [&](const char* name, bool picture, const std::string& of) {
    return McapChannel{std::string("/supertac/") + name,
                       picture ? "sensor_msgs/msg/Image" : "std_msgs/msg/Float32MultiArray",
                       picture ? kImage : kArray,
                       {{"unit", of},
                        {"array", array.text()},
                        {"pixel_mm", (picture && drawn ? image.pixel_mm : array.pitch_mm).text()}}};
  };
  const std::string heights = "1: the highest of the truth";
  std::vector<McapChannel> channels = {channel("taxels", false, unit),
                                       channel("picture", true, drawn ? heights : unit)};
  const std::string loads = "1: a taxel at the end of its range";
  channels.push_back({"/supertac/total_force", "std_msgs/msg/Float32", "float32 data\n", {{"unit", loads}}});
  channels.push_back({"/supertac/saturated", "std_msgs/msg/UInt32", "uint32 data\n", {{"unit", "signals"}}});
  if (half_widths) channels.push_back(channel("half_widths", true, heights));
  return channels;
}

}  // namespace

McapLog::McapLog(const OutputPath& output, const TaxelArray& array, const SignalScale& scale,
                 const ImageGrid& image, bool half_widths)
    : array_(array),
      scale_(scale),
      image_(image),
      file_(output, channels_of(array, scale.unit, image, half_widths)) {}

void McapLog::add(const LiveFrame& seen) {
  const std::span<const float> signals = seen.signals;
  const std::uint64_t published = nanoseconds(seen.time_s),
                      logged = std::isnan(seen.wall_s) ? published : nanoseconds(seen.wall_s);
  file_.add(0, logged, published, taxels_message(array_, signals));
  file_.add(1, logged, published,
            image_.pixels() > 0
                ? image_message(logged, image_.height, image_.width, 1, seen.picture)
                : image_message(logged, array_.rows, array_.columns, array_.channels, signals));
  const FrameLoad load = load_of(signals, array_.channels, scale_);
  file_.add(2, logged, published,
            Cdr().number(std::bit_cast<std::uint32_t>(static_cast<float>(load.total_force))).message());
  file_.add(3, logged, published, Cdr().number(load.saturated).message());
  if (!seen.half_widths.empty())
    file_.add(4, logged, published, image_message(logged, image_.height, image_.width, 1, seen.half_widths));
}

}  // namespace supertac
