#include "apps/stream/views/line_output.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

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

PipeOutput::PipeOutput(int file, bool patient) : file_(file), patient_(patient), thread_([this] { run(); }) {}

PipeOutput::~PipeOutput() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
    stopped_s_ = monotonic_seconds();
  }
  changed_.notify_one();
  thread_.join();
}

void PipeOutput::send(std::string line) {
  {
    std::unique_lock lock(mutex_);
    while (patient_ && !gone_ && waiting_.size() == kWaiting && !interrupted())
      changed_.wait_for(lock, std::chrono::milliseconds(kWaitMs));
    if (gone_) throw std::runtime_error("stdout: nobody reads it any more");
    if (waiting_.size() == kWaiting) {
      ++lost_;
      return;
    }
    waiting_.push_back(std::move(line));
  }
  changed_.notify_one();
}

void PipeOutput::run() {
  for (std::unique_lock lock(mutex_);;) {
    changed_.wait(lock, [this] { return stop_ || !waiting_.empty(); });
    if (waiting_.empty()) return;
    std::string text;
    for (const std::string& line : waiting_) text += line;
    waiting_.clear();
    lock.unlock();
    changed_.notify_one();
    const bool written = write_all(text);
    lock.lock();
    if (!written) {
      gone_ = true;
      return;
    }
  }
}

// Waits in steps, so that the end of the program need not wait for a reader that has stopped. The descriptor
// is shared with other programs and may not be made non-blocking; a pipe that polls ready takes PIPE_BUF
// bytes.
bool PipeOutput::write_all(const std::string& text) {
  constexpr std::size_t kAtOnce = 4096;
  for (std::size_t at = 0; at < text.size();) {
    pollfd ready{file_, POLLOUT, 0};
    const int polled = poll(&ready, 1, kWaitMs);
    {
      const std::lock_guard lock(mutex_);
      if (stop_ && monotonic_seconds() - stopped_s_ > kLastWaitS) return false;
    }
    if (polled <= 0) continue;
    const ssize_t count = ::write(file_, text.data() + at, std::min(kAtOnce, text.size() - at));
    if (count < 0 && errno != EINTR && errno != EAGAIN) return false;
    if (count > 0) at += static_cast<std::size_t>(count);
  }
  return true;
}

}  // namespace supertac
