#include "hardware/journal.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <fstream>

#include "hardware/errors.h"
#include "io/crc32.h"

namespace supertac {
namespace {

constexpr std::uint32_t kMagic = 0x314A5453;  // "STJ1"
constexpr std::size_t kChunkHeader = 24;      // magic, stream, length, CRC-32, time
constexpr std::size_t kRecordHeader = 13;     // kind, time, length
constexpr std::size_t kMostPending = 64 << 20;
constexpr auto kFlushEvery = std::chrono::milliseconds(200);
constexpr int kFlushesPerSync = 5;

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

// False when the records do not fill the payload exactly.
bool parse_records(std::span<const std::byte> payload, std::vector<JournalRecord>& records) {
  while (!payload.empty()) {
    if (payload.size() < kRecordHeader) return false;
    const auto length = get<std::uint32_t>(payload, 9);
    if (length > payload.size() - kRecordHeader) return false;
    const auto bytes = payload.subspan(kRecordHeader, length);
    records.push_back(
        {static_cast<RecordKind>(payload[0]), get<double>(payload, 1), {bytes.begin(), bytes.end()}});
    payload = payload.subspan(kRecordHeader + length);
  }
  return true;
}

}  // namespace

JournalWriter::JournalWriter(const std::string& path, std::string_view header) : path_(path) {
  descriptor_ = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  if (descriptor_ < 0) {
    throw JournalError("journal " + path + ": cannot be created: " + strerror(errno) +
                       (errno == EEXIST
                            ? "; recover it with supertac-import --journal, or choose another folder"
                            : "; choose a folder that can be written"));
  }
  append(Stream::header, RecordKind::text, 0, std::as_bytes(std::span(header)));
  flush();
  if (!error_.empty()) {
    ::close(descriptor_);
    throw JournalError(error_);
  }
  thread_ = std::thread([this] { run(); });
}

JournalWriter::~JournalWriter() {
  try {
    close();
  } catch (const JournalError&) {  // the owner did not ask
  }
}

void JournalWriter::append(Stream stream, RecordKind kind, double time_s, std::span<const std::byte> bytes) {
  std::lock_guard lock(mutex_);
  if (pending_bytes_ > kMostPending) {
    if (error_.empty()) error_ = "journal " + path_ + ": the disk is too slow, 64 MB wait to be written";
    return;
  }
  Pending& pending = pending_[stream];
  if (pending.payload.empty()) pending.time_s = time_s;
  pending_bytes_ += kRecordHeader + bytes.size();
  pending.payload.push_back(static_cast<std::byte>(kind));
  put(pending.payload, time_s);
  put(pending.payload, static_cast<std::uint32_t>(bytes.size()));
  pending.payload.insert(pending.payload.end(), bytes.begin(), bytes.end());
}

void JournalWriter::event(double time_s, std::string_view text) {
  append(Stream::event, RecordKind::text, time_s, std::as_bytes(std::span(text)));
}

void JournalWriter::check() {
  std::lock_guard lock(mutex_);
  if (!error_.empty()) throw JournalError(error_);
}

void JournalWriter::run() {
  for (int flushes = 1;; ++flushes) {
    bool last = false;
    {
      std::unique_lock lock(mutex_);
      last = wake_.wait_for(lock, kFlushEvery, [&] { return stop_; });
    }
    flush();
    if ((last || flushes % kFlushesPerSync == 0) && fdatasync(descriptor_) != 0) {
      std::lock_guard lock(mutex_);
      if (error_.empty()) error_ = "journal " + path_ + ": cannot be synced: " + strerror(errno);
    }
    if (last) return;
  }
}

void JournalWriter::flush() {
  std::map<Stream, Pending> chunks;
  {
    std::lock_guard lock(mutex_);
    chunks.swap(pending_);
    pending_bytes_ = 0;
    if (!error_.empty()) return;  // after a failed write nothing behind it would be read anyway
  }
  for (const auto& [stream, pending] : chunks) write_chunk(stream, pending);
}

void JournalWriter::write_chunk(Stream stream, const Pending& pending) {
  std::vector<std::byte> chunk;
  chunk.reserve(kChunkHeader + pending.payload.size());
  put(chunk, kMagic);
  put(chunk, static_cast<std::uint32_t>(stream));
  put(chunk, static_cast<std::uint32_t>(pending.payload.size()));
  put(chunk, std::uint32_t{0});
  put(chunk, pending.time_s);
  const std::uint32_t sum = chunk_sum(chunk, pending.payload);
  memcpy(chunk.data() + 12, &sum, sizeof sum);
  chunk.insert(chunk.end(), pending.payload.begin(), pending.payload.end());
  for (std::size_t done = 0; done < chunk.size();) {
    const ssize_t count = ::write(descriptor_, chunk.data() + done, chunk.size() - done);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) {
      std::lock_guard lock(mutex_);
      if (error_.empty()) {
        error_ = "journal " + path_ + ": cannot be written: " + strerror(count < 0 ? errno : ENOSPC) +
                 "; make room and start again, what was recorded so far is kept";
      }
      return;
    }
    done += static_cast<std::size_t>(count);
  }
}

void JournalWriter::close() {
  if (descriptor_ >= 0) {
    {
      std::lock_guard lock(mutex_);
      stop_ = true;
    }
    wake_.notify_all();
    if (thread_.joinable()) thread_.join();
    ::close(descriptor_);
    descriptor_ = -1;
  }
  check();
}

const std::vector<JournalRecord>& Journal::of(Stream stream) const {
  static const std::vector<JournalRecord> kNone;
  const auto found = streams.find(stream);
  return found == streams.end() ? kNone : found->second;
}

Journal parse_journal(std::span<const std::byte> bytes, const std::string& name) {
  Journal journal;
  bool first = true;
  while (bytes.size() >= kChunkHeader && get<std::uint32_t>(bytes, 0) == kMagic) {
    const auto stream = static_cast<Stream>(get<std::uint32_t>(bytes, 4));
    const auto length = get<std::uint32_t>(bytes, 8);
    if (length > bytes.size() - kChunkHeader) break;
    const auto payload = bytes.subspan(kChunkHeader, length);
    if (get<std::uint32_t>(bytes, 12) != chunk_sum(bytes.first(kChunkHeader), payload)) break;
    std::vector<JournalRecord> records;
    if (!parse_records(payload, records)) break;
    if (first && (stream != Stream::header || records.size() != 1)) break;
    if (first) journal.header = records[0].text();
    first = false;
    auto& all = journal.streams[stream];
    all.insert(all.end(), std::make_move_iterator(records.begin()), std::make_move_iterator(records.end()));
    bytes = bytes.subspan(kChunkHeader + length);
  }
  if (first) {
    throw JournalError("journal " + name +
                       ": expected a SuperTac journal, found other bytes or a damaged beginning");
  }
  journal.torn_bytes = bytes.size();
  return journal;
}

Journal read_journal(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw JournalError("journal " + path + ": cannot be opened; check the path");
  std::vector<std::byte> bytes;
  std::array<char, 1 << 16> buffer{};
  while (file.read(buffer.data(), buffer.size()), file.gcount() > 0) {
    const auto* data = reinterpret_cast<const std::byte*>(buffer.data());
    bytes.insert(bytes.end(), data, data + file.gcount());
  }
  if (file.bad()) throw JournalError("journal " + path + ": cannot be read");
  return parse_journal(bytes, path);
}

}  // namespace supertac
