// The append-only journal of a running collection. Chunks of {magic, stream, length, time, CRC-32, payload},
// at most 0.1 s apart - of the records' own time as well, which runs faster on a sped-up rig - and synced
// each second: kill -9 loses at most 0.5 s, a power cut 1.5 s. Chunks hold at most 2 kB, and the header
// stands there twice: what is damaged costs its own chunk only, and a torn tail is dropped. All counts are
// derived from the data.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "hardware/ports/port.h"

namespace supertac {

/// s: no time is later, nor any number of an event larger, so that no arithmetic on them can overflow.
constexpr double kLatestTime = 1e10;

enum class JournalStream : std::uint32_t { header = 1, board = 2, printer = 3, event = 4 };

/// What happened at a port. One record per call, so that a replay can give the same answers.
enum class RecordKind : std::uint8_t { received = 1, timed_out = 2, sent = 3, clock = 4, text = 5 };

struct JournalRecord {
  RecordKind kind = RecordKind::text;
  double time_s = 0;
  std::vector<std::byte> bytes;
  std::string text() const { return {reinterpret_cast<const char*>(bytes.data()), bytes.size()}; }
};

/// Writes one journal. Records may come from any thread; two threads of its own write and sync them.
class JournalWriter {
 public:
  /// Creates `path` (never overwrites). `header` is one line that says what is collected. Throws
  /// JournalError.
  JournalWriter(const std::string& path, std::string_view header);
  /// Writes what is left. Errors are lost here: call close() to see them.
  ~JournalWriter();
  JournalWriter(const JournalWriter&) = delete;
  JournalWriter& operator=(const JournalWriter&) = delete;

  /// Never waits for the disk; what goes wrong is in check().
  void append(JournalStream stream, RecordKind kind, double time_s, std::span<const std::byte> bytes);
  void event(double time_s, std::string_view text);
  /// Throws JournalError when a write has failed: the disk is full, or gone.
  void check();
  /// Writes and syncs everything. Throws JournalError.
  void close();
  /// Removes the file, for a run in which nothing was recorded: what is written on has no name.
  void discard();
  const std::string& path() const { return path_; }

 private:
  void run();
  void run_sync();
  void flush();
  void write_chunk(JournalStream stream, double time_s, std::span<const std::byte> payload);
  void sync();
  void failed(const std::string& what);

  std::string path_;
  int descriptor_ = -1;
  std::mutex mutex_;
  std::condition_variable wake_, stopping_;
  std::map<JournalStream, std::vector<std::vector<std::byte>>> pending_;  // payloads of chunks
  std::size_t pending_bytes_ = 0;
  double oldest_pending_ = 0;  // recorded time of the first record in pending_
  std::string error_;
  bool flush_due_ = false, stop_ = false;
  // Two threads: a disk may take seconds to sync, and what arrives meanwhile must not wait for it.
  std::thread thread_, sync_thread_;
};

/// What a journal holds, by stream; times are s of the clock of the port that was recorded.
struct Journal {
  std::string header;
  std::map<JournalStream, std::vector<JournalRecord>> streams;
  std::uint64_t torn_bytes = 0;  ///< at the end, dropped
  std::uint64_t lost_bytes = 0;  ///< damaged before that, dropped
  double lost_s = 0;             ///< of the records' time, between what stands before and behind the damage
  const std::vector<JournalRecord>& of(JournalStream stream) const;
};

/// Reads the undamaged chunks of a journal. Throws FileError when the file cannot be read, JournalError when
/// there is none, or no header among them.
Journal read_journal(const std::string& path);

/// The same from bytes in memory.
Journal parse_journal(std::span<const std::byte> bytes, const std::string& name);

// Raw capture and replay. A captured port writes everything that passes, with its times, to a journal; a
// replayed port gives the same bytes at the same times to a sensor's reader, which then gives the same
// frames.

class CapturedPort : public Port {
 public:
  /// `journal` must outlive the port.
  CapturedPort(std::unique_ptr<Port> port, JournalWriter& journal, JournalStream stream);
  const std::string& name() const override { return port_->name(); }
  unsigned baud() const override { return port_->baud(); }
  double now() override;
  Received read(std::span<std::byte> buffer, double until) override;
  double write(std::span<const std::byte> bytes, double until) override;

 private:
  std::unique_ptr<Port> port_;
  JournalWriter& journal_;
  JournalStream stream_;
};

class ReplayPort : public Port {
 public:
  /// Throws PortEnded at the end of the records, ReplayDiverged when the reader does something else than
  /// was recorded, JournalError when it does because of the damage to the journal, `lost_bytes`.
  ReplayPort(std::vector<JournalRecord> records, std::string name, std::uint64_t lost_bytes = 0);
  const std::string& name() const override { return name_; }
  double now() override;
  Received read(std::span<std::byte> buffer, double until) override;
  double write(std::span<const std::byte> bytes, double until) override;

 private:
  const JournalRecord& next(RecordKind expected);
  [[noreturn]] void diverged(const std::string& found, const std::string& done) const;
  std::vector<JournalRecord> records_;
  std::string name_;
  std::uint64_t lost_bytes_;
  std::size_t at_ = 0;
  std::size_t taken_ = 0;  // bytes of records_[at_] already given
};

}  // namespace supertac
