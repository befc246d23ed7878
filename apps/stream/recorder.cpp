#include "apps/stream/recorder.h"

#include <ctime>
#include <utility>

#include "io/files/file.h"

namespace supertac {
namespace {

std::string name_of_now() {
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  localtime_r(&now, &local);
  char text[64];
  const std::size_t size = std::strftime(text, sizeof text, "recording_%Y%m%d_%H%M%S.safetensors", &local);
  return {text, size};
}

}  // namespace

std::string Recorder::finish() {
  stop();
  std::vector<std::thread> writers;
  {
    const std::lock_guard lock(log_mutex_);
    writers.swap(writers_);
  }
  for (std::thread& writer : writers) writer.join();
  return status().said;
}

std::string Recorder::start() {
  const std::string name = name_of_now();
  try {
    // Two recordings may begin within a second.
    const OutputPath output(name, [this](const std::string& line) { taken_ = line; });
    auto log = std::make_unique<PictureLog>(output, format_);
    const std::scoped_lock lock(log_mutex_, mutex_);
    if (log_) return "already recording " + status_.recording;
    log_ = std::move(log);
    status_.recording = name;
    begin_s_ = -1, seconds_ = 0;
    return "recording " + name;
  } catch (const std::exception& error) {
    return error.what();
  }
}

std::string Recorder::stop() {
  const std::lock_guard lock(log_mutex_);
  return log_ ? close("") : "nothing is being recorded";
}

std::string Recorder::close(const std::string& why) {
  const std::lock_guard lock(mutex_);
  const std::string name = std::exchange(status_.recording, "");
  writers_.emplace_back(&Recorder::complete, this, std::move(log_), name, why);
  return status_.said = "writing " + name;
}

void Recorder::complete(std::unique_ptr<PictureLog> log, std::string name, const std::string& why) {
  const std::lock_guard writing(write_mutex_);  // one after the other
  const std::string recorded = "recorded " + name;
  std::string said = recorded;
  taken_.clear();
  try {
    log->write(metadata_);
    if (log->empty()) said = "no frame came: nothing was recorded";
    if (!taken_.empty()) said = taken_;
  } catch (const std::exception& error) {
    said = error.what();
  }
  const std::lock_guard lock(mutex_);
  status_.said = said + (why.empty() || said != recorded ? "" : "; " + why);
}

void Recorder::add(const LiveFrame& seen) {
  const std::lock_guard lock(log_mutex_);
  if (!log_) return;
  if (begin_s_ < 0) begin_s_ = seen.time_s;
  seconds_ = seen.time_s - begin_s_;
  try {
    log_->add(seen);
  } catch (const FileError& error) {
    close(error.what());
  }
}

Recorder::Status Recorder::status() {
  const std::lock_guard lock(mutex_);
  Status status = status_;
  status.seconds = seconds_;
  return status;
}

}  // namespace supertac
