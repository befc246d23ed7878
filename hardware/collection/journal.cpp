#include "hardware/collection/journal.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "hardware/ports/errors.h"
#include "io/files/file.h"
#include "io/numbers/hash.h"

namespace supertac {
namespace {

constexpr std::uint32_t kMagic = 0x314A5453;  // "STJ1"
constexpr std::size_t kChunkHeader = 24;      // magic, stream, length, CRC-32, time
constexpr std::size_t kRecordHeader = 13;     // kind, time, length
constexpr std::size_t kMostPayload = 2048;    // of whole records, where one is not longer
constexpr double kFlushAfter = 0.1;           // of recorded time, and of the wall's

template <class T>
void put(std::vector<std::byte>& out, T value) {
  const auto* bytes = reinterpret_cast<const std::byte*>(&value);
  out.insert(out.end(), bytes, bytes + sizeof value);
}

template <class T>
T get(std::span<const std::byte> bytes, std::size_t at) {
  T value;
  memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

// Over stream, length, time and payload: everything that can change the meaning.
std::uint32_t chunk_sum(std::span<const std::byte> header, std::span<const std::byte> payload) {
  return crc32(payload, crc32(header.subspan(16, 8), crc32(header.subspan(4, 8))));
}

// False when the records do not fill the payload exactly, or when a time is none.
bool parse_records(std::span<const std::byte> payload, std::vector<JournalRecord>& records) {
  while (!payload.empty()) {
    if (payload.size() < kRecordHeader) return false;
    const auto length = get<std::uint32_t>(payload, 9);
    if (length > payload.size() - kRecordHeader) return false;
    const auto time_s = get<double>(payload, 1);
    if (!(std::abs(time_s) < kLatestTime)) return false;
    const auto bytes = payload.subspan(kRecordHeader, length);
    records.push_back({static_cast<RecordKind>(payload[0]), time_s, {bytes.begin(), bytes.end()}});
    payload = payload.subspan(kRecordHeader + length);
  }
  return true;
}

}  // namespace

JournalWriter::JournalWriter(const std::string& path, std::string_view header) : path_(path) {
  descriptor_ = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  if (descriptor_ < 0) {
    throw JournalError("journal " + path + ": cannot be created: " + strerror(errno) +
                       (errno == EEXIST
                            ? "; recover it with supertac-import --journal, or choose another folder"
                            : "; choose a folder that can be written"));
  }
  for (int copy = 0; copy < 2; ++copy) {
    append(JournalStream::header, RecordKind::text, 0, std::as_bytes(std::span(header)));
    flush();
  }
  if (error_.empty() && !sync_folder_of(path)) failed("its folder cannot be synced");
  if (!error_.empty()) {
    (void)::close(descriptor_);
    (void)::unlink(path.c_str());
    throw JournalError(error_);
  }
  thread_ = std::thread([this] { run(); });
  sync_thread_ = std::thread([this] { run_sync(); });
}

JournalWriter::~JournalWriter() {
  try {
    close();
  } catch (const JournalError&) {  // the owner did not ask
  }
}

void JournalWriter::append(JournalStream stream, RecordKind kind, double time_s,
                           std::span<const std::byte> bytes) {
  std::lock_guard lock(mutex_);
  if (pending_bytes_ > (64 << 20)) {
    if (error_.empty()) error_ = "journal " + path_ + ": the disk is too slow, 64 MB wait to be written";
    return;
  }
  if (pending_bytes_ == 0) oldest_pending_ = time_s;
  if (time_s - oldest_pending_ > kFlushAfter && !flush_due_) {
    flush_due_ = true;
    wake_.notify_all();
  }
  std::vector<std::vector<std::byte>>& chunks = pending_[stream];
  if (chunks.empty() || chunks.back().size() + kRecordHeader + bytes.size() > kMostPayload)
    chunks.emplace_back();
  std::vector<std::byte>& payload = chunks.back();
  pending_bytes_ += kRecordHeader + bytes.size();
  payload.push_back(static_cast<std::byte>(kind));
  put(payload, time_s);
  put(payload, static_cast<std::uint32_t>(bytes.size()));
  payload.insert(payload.end(), bytes.begin(), bytes.end());
}

void JournalWriter::event(double time_s, std::string_view text) {
  append(JournalStream::event, RecordKind::text, time_s, std::as_bytes(std::span(text)));
}

void JournalWriter::check() {
  std::lock_guard lock(mutex_);
  if (!error_.empty()) throw JournalError(error_);
}

void JournalWriter::run() {
  for (bool last = false; !last;) {
    {
      std::unique_lock lock(mutex_);
      wake_.wait_for(lock, std::chrono::duration<double>(kFlushAfter), [&] { return stop_ || flush_due_; });
      last = stop_;
    }
    flush();
  }
}

void JournalWriter::run_sync() {
  for (;;) {
    {
      std::unique_lock lock(mutex_);
      if (stopping_.wait_for(lock, std::chrono::seconds(1), [&] { return stop_; })) return;
    }
    sync();
  }
}

void JournalWriter::sync() {
  if (::fsync(descriptor_) != 0) failed("cannot be synced");
}

void JournalWriter::failed(const std::string& what) {
  const std::string reason = strerror(errno);
  std::lock_guard lock(mutex_);
  if (!error_.empty()) return;
  error_ =
      "journal " + path_ + ": " + what + ": " + reason + "; make room or change the disk and start again";
}

void JournalWriter::flush() {
  decltype(pending_) chunks;
  {
    std::lock_guard lock(mutex_);
    chunks.swap(pending_);
    pending_bytes_ = 0;
    flush_due_ = false;
    if (!error_.empty()) return;  // after a failed write nothing behind it would be read anyway
  }
  for (const auto& [stream, payloads] : chunks)
    for (const auto& payload : payloads) write_chunk(stream, get<double>(payload, 1), payload);
}

void JournalWriter::write_chunk(JournalStream stream, double time_s, std::span<const std::byte> payload) {
  std::vector<std::byte> chunk;
  chunk.reserve(kChunkHeader + payload.size());
  put(chunk, kMagic);
  put(chunk, static_cast<std::uint32_t>(stream));
  put(chunk, static_cast<std::uint32_t>(payload.size()));
  put(chunk, std::uint32_t{0});
  put(chunk, time_s);
  const std::uint32_t sum = chunk_sum(chunk, payload);
  memcpy(chunk.data() + 12, &sum, sizeof sum);
  chunk.insert(chunk.end(), payload.begin(), payload.end());
  if (!write_all(descriptor_, chunk)) failed("cannot be written");
}

void JournalWriter::close() {
  if (descriptor_ >= 0) {
    {
      std::lock_guard lock(mutex_);
      stop_ = true;
    }
    wake_.notify_all();
    stopping_.notify_all();
    if (thread_.joinable()) thread_.join();
    if (sync_thread_.joinable()) sync_thread_.join();
    sync();
    const int descriptor = std::exchange(descriptor_, -1);
    if (::close(descriptor) != 0) failed("cannot be closed");
  }
  check();
}

void JournalWriter::discard() { (void)::unlink(path_.c_str()); }

const std::vector<JournalRecord>& Journal::of(JournalStream stream) const {
  static const std::vector<JournalRecord> kNone;
  const auto found = streams.find(stream);
  return found == streams.end() ? kNone : found->second;
}

namespace {

struct Chunk {
  JournalStream stream = JournalStream::header;
  double time_s = 0;
  std::size_t size = 0;    // 0: there is no whole chunk here
  std::size_t summed = 0;  // bytes looked at to find that out
  std::vector<JournalRecord> records;
};

Chunk chunk_at(std::span<const std::byte> bytes) {
  Chunk chunk;
  if (bytes.size() < kChunkHeader || get<std::uint32_t>(bytes, 0) != kMagic) return chunk;
  const auto length = get<std::uint32_t>(bytes, 8);
  if (length > bytes.size() - kChunkHeader) return chunk;
  const auto payload = bytes.subspan(kChunkHeader, length);
  chunk.summed = length;
  if (get<std::uint32_t>(bytes, 12) != chunk_sum(bytes.first(kChunkHeader), payload)) return chunk;
  chunk.stream = static_cast<JournalStream>(get<std::uint32_t>(bytes, 4));
  if (!parse_records(payload, chunk.records)) return chunk;
  chunk.time_s = get<double>(bytes, 16);
  chunk.size = kChunkHeader + length;
  return chunk;
}

// The next place where a chunk may begin, behind the first byte.
std::size_t next_magic(std::span<const std::byte> bytes) {
  const auto magic = std::as_bytes(std::span(&kMagic, 1));
  return static_cast<std::size_t>(std::search(bytes.begin() + 1, bytes.end(), magic.begin(), magic.end()) -
                                  bytes.begin());
}

}  // namespace

Journal parse_journal(std::span<const std::byte> bytes, const std::string& name) {
  Journal journal;
  bool headed = false;
  std::uint64_t damaged = 0;  // since the last whole chunk
  double before_s = 0;        // time of that chunk
  // A file made of beginnings of chunks would have all of it summed up at each of them.
  std::size_t patience = 16 * bytes.size() + (1 << 20);
  while (!bytes.empty()) {
    Chunk chunk = chunk_at(bytes);
    if (chunk.size == 0) {
      const std::size_t skipped = chunk.summed > patience ? bytes.size() : next_magic(bytes);
      patience -= std::min(patience, chunk.summed);
      damaged += skipped;
      bytes = bytes.subspan(skipped);
      continue;
    }
    const bool is_header = chunk.stream == JournalStream::header;
    if (is_header && !headed && chunk.records.size() == 1) {
      journal.header = chunk.records[0].text();
      headed = true;
    }
    if (damaged > 0 && !is_header && before_s > 0) journal.lost_s += std::max(0.0, chunk.time_s - before_s);
    journal.lost_bytes += std::exchange(damaged, 0);
    if (!is_header) before_s = chunk.time_s;
    auto& all = journal.streams[chunk.stream];
    all.insert(all.end(), std::make_move_iterator(chunk.records.begin()),
               std::make_move_iterator(chunk.records.end()));
    bytes = bytes.subspan(chunk.size);
  }
  if (!headed) {
    throw JournalError("journal " + name +
                       ": expected a SuperTac journal, found other bytes or a damaged beginning");
  }
  journal.torn_bytes = damaged;
  return journal;
}

Journal read_journal(const std::string& path) {
  return parse_journal(read_file(path, std::uint64_t{1} << 36), path);
}

CapturedPort::CapturedPort(std::unique_ptr<Port> port, JournalWriter& journal, JournalStream stream)
    : port_(std::move(port)), journal_(journal), stream_(stream) {}

double CapturedPort::now() {
  const double time = port_->now();
  journal_.append(stream_, RecordKind::clock, time, {});
  return time;
}

Received CapturedPort::read(std::span<std::byte> buffer, double until) {
  const Received got = port_->read(buffer, until);
  const RecordKind kind = got.count > 0 ? RecordKind::received : RecordKind::timed_out;
  journal_.append(stream_, kind, got.time_s, buffer.first(got.count));
  return got;
}

double CapturedPort::write(std::span<const std::byte> bytes, double until) {
  const double time = port_->write(bytes, until);
  journal_.append(stream_, RecordKind::sent, time, bytes);
  return time;
}

ReplayPort::ReplayPort(std::vector<JournalRecord> records, std::string name, std::uint64_t lost_bytes)
    : records_(std::move(records)), name_(std::move(name)), lost_bytes_(lost_bytes) {}

void ReplayPort::diverged(const std::string& found, const std::string& done) const {
  const std::string at = "replay " + name_ + ": record " + std::to_string(at_);
  if (lost_bytes_ > 0)
    throw JournalError(at + " does not follow on what stands before, for " + std::to_string(lost_bytes_) +
                       " bytes of the journal are damaged; supertac-import --journal reads the rest of a "
                       "collection's");
  throw ReplayDiverged(at + " " + found + ", the driver now " + done +
                       "; replay with the program and settings that recorded it");
}

const JournalRecord& ReplayPort::next(RecordKind expected) {
  if (at_ >= records_.size()) throw PortEnded("replay " + name_ + ": the end of the recording");
  const JournalRecord& record = records_[at_];
  if (record.kind != expected)
    diverged("is of kind " + std::to_string(static_cast<int>(record.kind)),
             "did " + std::to_string(static_cast<int>(expected)));
  return record;
}

double ReplayPort::now() {
  // A driver that reads less at once than the one that was recorded asks in between.
  if (taken_ > 0) return records_[at_].time_s;
  const double time = next(RecordKind::clock).time_s;
  ++at_;
  return time;
}

Received ReplayPort::read(std::span<std::byte> buffer, double) {
  if (at_ < records_.size() && records_[at_].kind == RecordKind::timed_out)
    return {0, records_[at_++].time_s};
  const JournalRecord& record = next(RecordKind::received);
  const std::size_t count = std::min(buffer.size(), record.bytes.size() - taken_);
  std::copy_n(record.bytes.begin() + static_cast<std::ptrdiff_t>(taken_), count, buffer.begin());
  taken_ += count;
  const double time = record.time_s;
  if (taken_ == record.bytes.size()) {
    taken_ = 0;
    ++at_;
  }
  return {count, time};
}

double ReplayPort::write(std::span<const std::byte>, double) {
  throw ReplayDiverged("replay " + name_ + ": a recorded sensor hears nothing that is written to it");
}

}  // namespace supertac
