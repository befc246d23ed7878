#include "apps/stream/views/line_output.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
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

}  // namespace supertac
