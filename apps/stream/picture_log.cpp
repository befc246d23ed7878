#include "apps/stream/picture_log.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <atomic>
#include <ctime>
#include <filesystem>
#include <functional>
#include <numeric>
#include <utility>

#include "io/files/file.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr std::uint64_t kCheckBytes = 64 << 10, kSpareBytes = 256 << 10;  // of room for the files
// For the files of all logs, which may lie on one disk.
std::atomic<std::uint64_t> waiting_bytes{0};

std::string name_of_now() {
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  localtime_r(&now, &local);
  char text[64];
  const std::size_t size = std::strftime(text, sizeof text, "recording_%Y%m%d_%H%M%S.safetensors", &local);
  return {text, size};
}

}  // namespace

PictureLog::PictureLog(OutputPath output, const PictureFormat& format)
    : output_(std::move(output)), format_(format) {
  refuse_existing(output_.path, !output_.when_taken);
  const std::vector<std::uint64_t> picture{static_cast<std::uint64_t>(format.image.height),
                                           static_cast<std::uint64_t>(format.image.width)};
  add_column(format.tensor, {format.signals}, &LiveFrame::signals);
  if (format.image.pixels() > 0) add_column("pictures", picture, &LiveFrame::picture);
  if (format.half_widths) add_column("half_widths", picture, &LiveFrame::half_widths);
}

PictureLog::~PictureLog() { waiting_bytes -= bytes_; }

void PictureLog::fail() {
  problem_ =
      std::string("nothing can be kept there: ") + strerror(errno) + "; make room, or choose another folder";
  throw FileError(output_.path, problem_);
}

void PictureLog::add_column(const char* name, std::vector<std::uint64_t> row,
                            std::span<const float> LiveFrame::*values) {
  std::string file = (std::filesystem::absolute(output_.path).parent_path() / ".pictures-XXXXXX").string();
  const int spool = mkostemp(file.data(), O_CLOEXEC);
  if (spool < 0) fail();
  unlink(file.c_str());
  columns_.push_back({name, std::move(row), values, Spool(fdopen(spool, "w+b"))});
  if (!columns_.back().spool) fail();
}

// A file is as large as what waits for it, which goes only when it is complete.
void PictureLog::check_room(std::uint64_t row_bytes) {
  if (bytes_ + row_bytes < checked_bytes_ + kCheckBytes) return;
  checked_bytes_ = bytes_ + row_bytes;
  std::error_code error;
  const auto space = std::filesystem::space(std::filesystem::absolute(output_.path).parent_path(), error);
  if (error || space.available > waiting_bytes + 2 * row_bytes + kSpareBytes) return;
  throw FileError(output_.path, "the disk is nearly full: the " + std::to_string(times_.size()) +
                                    " frames until here are kept; make room, or choose another folder");
}

void PictureLog::add(const LiveFrame& seen) {
  const std::uint64_t row_bytes =
      64 + sizeof(float) * (seen.signals.size() + seen.picture.size() + seen.half_widths.size());
  check_room(row_bytes);
  if (times_.empty()) began_s_ = seen.wall_s - seen.time_s;
  for (const Column& column : columns_) {
    const std::span<const float> values = seen.*column.values;
    if (std::fwrite(values.data(), sizeof(float), values.size(), column.spool.get()) != values.size()) fail();
  }
  bytes_ += row_bytes, waiting_bytes += row_bytes;
  times_.push_back(seen.time_s);
  if (format_.distance) distances_.push_back(static_cast<float>(seen.distance.value_or(0)));
  if (seen.arrival && format_.image.pixels() == 0) arrivals_.push_back(*seen.arrival);
}

// What the board's clock said, now that all frames are known; `kept` says which have a time. None where there
// are too few to know the clock by.
std::vector<double> PictureLog::dated_times(std::vector<bool>& kept) const {
  const FrameTimeline timeline = timeline_of({}, arrivals_);
  std::vector<double> times;
  for (const FrameDate& date : timeline.dates) {
    kept.push_back(date.doubt_s() <= kTrustedS);
    if (kept.back()) times.push_back(times_.front() + date.time_s - timeline.dates.front().time_s);
  }
  return times;
}

void PictureLog::read_back(const Column& column, const std::vector<bool>& kept, const ByteSink& sink) {
  std::FILE* const file = column.spool.get();
  if (std::fflush(file) != 0 || std::fseek(file, 0, SEEK_SET) != 0) fail();
  std::vector<float> row(
      std::accumulate(column.row.begin(), column.row.end(), std::size_t{1}, std::multiplies()));
  for (const bool wanted : kept) {
    if (std::fread(row.data(), sizeof(float), row.size(), file) != row.size()) fail();
    if (wanted) sink(std::as_bytes(std::span(row)));
  }
}

void PictureLog::write(std::map<std::string, std::string> metadata) {
  if (!problem_.empty()) throw FileError(output_.path, problem_);
  if (empty()) return;  // nothing takes no name, and replaces nothing
  if (!std::isnan(began_s_)) metadata["began_s"] = supertac::format(began_s_);
  std::vector<double> times;
  std::vector<bool> kept;
  if (arrivals_.size() == times_.size()) {
    times = dated_times(kept);
    if (times.empty()) metadata["doubt"] = "too short to know the board's clock: dated as the frames came";
  }
  if (times.empty()) times = times_, kept.assign(times_.size(), true);
  left_out_ = times_.size() - times.size();
  if (left_out_ > 0) metadata["left_out_frames"] = std::to_string(left_out_);
  std::vector<TensorToWrite> tensors = {
      {"time_s", "F64", {times.size()}, std::as_bytes(std::span(times)), {}}};
  for (const Column& column : columns_) {
    std::vector<std::uint64_t> shape = column.row;
    shape.insert(shape.begin(), times.size());
    tensors.push_back(
        {column.name, "F32", shape, {}, [&](const ByteSink& sink) { read_back(column, kept, sink); }});
  }
  if (format_.distance)
    tensors.push_back({"distances", "F32", {times.size()}, std::as_bytes(std::span(distances_)), {}});
  write_safetensors(output_, metadata, tensors);
}

std::string Recorder::finish() {
  stop();
  std::future<void> writing;
  {
    const std::lock_guard lock(log_mutex_);
    writing = std::move(writing_);
  }
  if (writing.valid()) writing.wait();
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
  writing_ = std::async(std::launch::async,
                        [this, held = std::move(log_), name, why, before = std::move(writing_)]() mutable {
                          // A future keeps what its function holds: the file goes with this one, and the
                          // future before with it.
                          const std::unique_ptr<PictureLog> log = std::move(held);
                          if (before.valid()) before.get();  // one after the other
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
                          const std::lock_guard writing(mutex_);
                          status_.said = said + (why.empty() || said != recorded ? "" : "; " + why);
                        });
  return status_.said = "writing " + name;
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
