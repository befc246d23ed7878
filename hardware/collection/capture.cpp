// Ports whose bytes a journal keeps, or has kept.
#include "hardware/collection/journal.h"

#include <algorithm>
#include <utility>

#include "hardware/ports/errors.h"

namespace supertac {

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
  diverged("is what a sensor sent", "writes to it");
}

}  // namespace supertac
