#include "apps/stream/picture_log.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <filesystem>

#include "io/files/file.h"
#include "io/numbers/numbers.h"

namespace supertac {
namespace {

constexpr std::uint64_t kCheckBytes = 64 << 10, kSpareBytes = 256 << 10;  // of room for the files
// In the temporary files of all logs, which may lie on one disk and become as large files.
std::atomic<std::uint64_t> waiting_bytes{0};

}  // namespace

PictureLog::PictureLog(OutputPath output, const PictureFormat& format)
    : output_(std::move(output)), format_(format) {
  refuse_existing(output_.path, !output_.when_taken);
  times_ = open_spool();
  signals_ = open_spool();
  if (format.image.pixels() > 0) pictures_ = open_spool();
  if (format.half_widths) half_widths_ = open_spool();
  if (format.distance) distances_ = open_spool();
}

PictureLog::~PictureLog() { waiting_bytes -= bytes_; }

void PictureLog::fail() {
  problem_ =
      std::string("nothing can be kept there: ") + strerror(errno) + "; make room, or choose another folder";
  throw FileError(output_.path, problem_);
}

PictureLog::Spool PictureLog::open_spool() {
  std::string name = (std::filesystem::absolute(output_.path).parent_path() / ".pictures-XXXXXX").string();
  const int file = mkostemp(name.data(), O_CLOEXEC);
  if (file < 0) fail();
  unlink(name.c_str());
  Spool spool(fdopen(file, "w+b"));
  if (!spool) fail();
  return spool;
}

void PictureLog::append(const Spool& spool, std::span<const std::byte> bytes) {
  if (std::fwrite(bytes.data(), 1, bytes.size(), spool.get()) != bytes.size()) fail();
  bytes_ += bytes.size(), waiting_bytes += bytes.size();
}

// A file is as large as the temporary ones, which go only when it is complete.
void PictureLog::check_room(const LiveFrame& next) {
  const std::uint64_t row =
      64 + sizeof(float) * (next.signals.size() + next.picture.size() + next.half_widths.size());
  if (bytes_ + row < checked_bytes_ + kCheckBytes) return;
  checked_bytes_ = bytes_ + row;
  std::error_code error;
  const auto space = std::filesystem::space(std::filesystem::absolute(output_.path).parent_path(), error);
  if (error || space.available > waiting_bytes + 2 * row + kSpareBytes) return;
  throw FileError(output_.path, "the disk is nearly full: the " + std::to_string(count_) +
                                    " frames until here are kept; make room, or choose another folder");
}

void PictureLog::add(const LiveFrame& seen) {
  check_room(seen);
  if (count_ == 0) began_s_ = seen.wall_s - seen.time_s, first_s_ = seen.time_s;
  append(times_, std::as_bytes(std::span(&seen.time_s, 1)));
  append(signals_, std::as_bytes(seen.signals));
  if (pictures_) append(pictures_, std::as_bytes(seen.picture));
  if (half_widths_) append(half_widths_, std::as_bytes(seen.half_widths));
  const auto distance = static_cast<float>(seen.distance.value_or(0));
  if (distances_) append(distances_, std::as_bytes(std::span(&distance, 1)));
  if (seen.arrival && !pictures_) arrivals_.push_back(*seen.arrival);
  ++count_;
}

// What the board's clock said, now that all frames are known.
std::vector<double> PictureLog::dated_times() {
  const FrameTimeline timeline = timeline_of({}, arrivals_);
  std::vector<double> times;
  for (const FrameDate& date : timeline.dates) {
    kept_.push_back(date.doubt_s() <= kTrustedS);
    if (kept_.back()) times.push_back(first_s_ + date.time_s - timeline.dates.front().time_s);
  }
  if (!times.empty()) left_out_ = count_ - times.size();
  return times;
}

void PictureLog::read_rows(const Spool& spool, std::size_t row_bytes, const ByteSink& sink) {
  std::vector<std::byte> row;
  std::size_t number = 0;
  read_back(spool, [&](std::span<const std::byte> bytes) {
    for (; !bytes.empty();) {
      const auto part = bytes.first(std::min(bytes.size(), row_bytes - row.size()));
      row.insert(row.end(), part.begin(), part.end());
      bytes = bytes.subspan(part.size());
      if (row.size() < row_bytes) return;
      if (kept_[number++]) sink(row);
      row.clear();
    }
  });
}

void PictureLog::read_back(const Spool& spool, const ByteSink& sink) {
  if (std::fflush(spool.get()) != 0 || std::fseek(spool.get(), 0, SEEK_SET) != 0) fail();
  std::array<std::byte, 1 << 16> buffer;
  while (const std::size_t count = std::fread(buffer.data(), 1, buffer.size(), spool.get()))
    sink(std::span(buffer).first(count));
  if (std::ferror(spool.get()) != 0) fail();
}

void PictureLog::write(std::map<std::string, std::string> metadata) {
  if (!problem_.empty()) throw FileError(output_.path, problem_);
  if (count_ == 0) return;  // nothing takes no name, and replaces nothing
  if (!std::isnan(began_s_)) metadata["began_s"] = supertac::format(began_s_);
  if (arrivals_.size() == count_) {
    const std::vector<double> times = dated_times();
    const std::uint64_t kept = count_ - left_out_, row = format_.signals * sizeof(float);
    if (left_out_ > 0) metadata["left_out_frames"] = std::to_string(left_out_);
    if (times.empty()) metadata["doubt"] = "too short to know the board's clock: dated as the frames came";
    const auto rows = [&](const ByteSink& sink) { read_rows(signals_, row, sink); };
    if (!times.empty())
      return write_safetensors(output_, metadata,
                               {{"time_s", "F64", {kept}, std::as_bytes(std::span(times)), {}},
                                {format_.tensor, "F32", {kept, format_.signals}, {}, rows}});
  }
  const auto from = [this](const Spool& spool) {
    return [this, &spool](const ByteSink& sink) { read_back(spool, sink); };
  };
  const auto height = static_cast<std::uint64_t>(format_.image.height),
             width = static_cast<std::uint64_t>(format_.image.width);
  std::vector<TensorToWrite> tensors = {
      {"time_s", "F64", {count_}, {}, from(times_)},
      {format_.tensor, "F32", {count_, format_.signals}, {}, from(signals_)}};
  if (pictures_) tensors.push_back({"pictures", "F32", {count_, height, width}, {}, from(pictures_)});
  if (half_widths_)
    tensors.push_back({"half_widths", "F32", {count_, height, width}, {}, from(half_widths_)});
  if (distances_) tensors.push_back({"distances", "F32", {count_}, {}, from(distances_)});
  write_safetensors(output_, metadata, tensors);
}

}  // namespace supertac
