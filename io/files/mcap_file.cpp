#include "io/files/mcap_file.h"

#include <algorithm>
#include <numeric>

#include "io/numbers/hash.h"

namespace supertac {
namespace {

constexpr std::string_view kMagic = "\x89MCAP0\r\n";
constexpr std::size_t kChunkBytes = 256 << 10;

enum Opcode : std::uint8_t {
  kHeader = 1,
  kFooter = 2,
  kSchema = 3,
  kChannel = 4,
  kMessage = 5,
  kChunk = 6,
  kMessageIndex = 7,
  kChunkIndex = 8,
  kStatistics = 11,
  kDataEnd = 15
};

// Little-endian, as every processor that we build for.
template <class Number>
std::string bytes(Number value) {
  return {reinterpret_cast<const char*>(&value), sizeof value};
}
std::string u16(std::size_t value) { return bytes(static_cast<std::uint16_t>(value)); }
std::string u32(std::size_t value) { return bytes(static_cast<std::uint32_t>(value)); }
std::string u64(std::uint64_t value) { return bytes(value); }
// Texts, maps and lists have their length in bytes before them.
std::string sized(std::string_view text) { return u32(text.size()).append(text); }

std::string record(Opcode opcode, std::string_view content) {
  return (bytes(opcode) + u64(content.size())).append(content);
}

std::uint32_t sum_of(std::string_view text, std::uint32_t seed = 0) {
  return crc32(std::as_bytes(std::span(text)), seed);
}

}  // namespace

void McapFile::Span::add(std::uint64_t time) { first = std::min(first, time), last = std::max(last, time); }

std::string McapFile::Span::text() const { return u64(first <= last ? first : 0) + u64(last); }

McapFile::McapFile(const OutputPath& output, std::span<const McapChannel> channels)
    : file_(output), in_chunk_(channels.size()), counts_(channels.size()) {
  for (std::size_t i = 0; i < channels.size(); ++i) {
    const McapChannel& c = channels[i];
    std::string metadata;
    for (const auto& [key, value] : c.metadata) metadata += sized(key) + sized(value);
    channels_ += record(kSchema, u16(i + 1) + sized(c.schema) + sized("ros2msg") + sized(c.schema_text)) +
                 record(kChannel, u16(i) + u16(i + 1) + sized(c.topic) + sized("cdr") + sized(metadata));
  }
  write(std::string(kMagic) + record(kHeader, sized("ros2") + sized("supertac")) + channels_);
}

void McapFile::write(std::string_view text) {
  try {
    file_.write(text);
  } catch (...) {
    failure_ = std::current_exception();
    throw;
  }
  at_ += text.size();
}

void McapFile::add(std::size_t channel, std::uint64_t log_time, std::uint64_t publish_time,
                   std::string_view message) {
  in_chunk_[channel].push_back({log_time, chunk_.size()});
  chunk_span_.add(log_time), span_.add(log_time);
  chunk_ += record(
      kMessage, (u16(channel) + u32(counts_[channel]++) + u64(log_time) + u64(publish_time)).append(message));
  if (chunk_.size() >= kChunkBytes) write_chunk();
}

void McapFile::write_chunk() {
  if (chunk_.empty()) return;
  const std::uint64_t begin = at_;
  const std::string none = sized("");  // compression
  write(record(kChunk, chunk_span_.text() + u64(chunk_.size()) + u32(sum_of(chunk_)) + none +
                           u64(chunk_.size()) + chunk_));
  const std::uint64_t end = at_;
  std::string places;
  for (std::size_t channel = 0; channel < in_chunk_.size(); ++channel) {
    std::string entries;
    for (const Entry& e : in_chunk_[channel]) entries += u64(e.time) + u64(e.offset);
    if (entries.empty()) continue;
    places += u16(channel) + u64(at_);
    write(record(kMessageIndex, u16(channel) + sized(entries)));
    in_chunk_[channel].clear();
  }
  chunk_indexes_ += record(kChunkIndex, chunk_span_.text() + u64(begin) + u64(end - begin) + sized(places) +
                                            u64(at_ - end) + none + u64(chunk_.size()) + u64(chunk_.size()));
  chunk_.clear(), chunk_span_ = {}, ++chunks_;
}

void McapFile::close() {
  if (failure_) std::rethrow_exception(failure_);
  write_chunk();
  write(record(kDataEnd, u32(0)));  // no sum over all: each chunk has its own
  std::string counts;
  for (std::size_t channel = 0; channel < counts_.size(); ++channel)
    counts += u16(channel) + u64(counts_[channel]);
  const std::uint64_t messages = std::accumulate(counts_.begin(), counts_.end(), std::uint64_t{0});
  const std::string statistics = u64(messages) + u16(counts_.size()) + u32(counts_.size()) + u32(0) + u32(0) +
                                 u32(chunks_) + span_.text() + sized(counts);
  // What a reader looks at first.
  const std::string summary = channels_ + record(kStatistics, statistics) + chunk_indexes_;
  constexpr std::size_t kFooterBytes = 8 + 8 + 4;
  const std::string footer = bytes(kFooter) + u64(kFooterBytes) + u64(at_) + u64(0);
  write(summary + footer + u32(sum_of(footer, sum_of(summary))));
  write(kMagic);
  file_.commit();
}

}  // namespace supertac
