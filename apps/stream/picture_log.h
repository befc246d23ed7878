// A stream as a safetensors file: a recording of its signals, or its pictures, of all of it or at somebody's
// wish.
#pragma once

#include <atomic>
#include <cstdio>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "apps/stream/live_frame.h"
#include "io/files/safetensors.h"

namespace supertac {

/// Keeps the signals of a stream, or its pictures, for a safetensors file. Signals alone make a recording
/// (data/recordings/recording.h): time_s and signals. With pictures it has tensors time_s F64 [n], signals
/// (or volts) F32 [n,signals] and pictures F32 [n,height,width]; of a model that says how sure it is also
/// half_widths F32 [n,height,width], of its pixels' 90 % intervals, and distances F32 [n] from its training.
/// Metadata "began_s" is the wall-clock time of time_s 0 (s since 1970), where it is known. How many there
/// will be is not known before the end, and signals and pictures do not fit into memory (1 MB/s): they wait
/// in nameless temporary files beside the final one. A recording of a board is dated at its end, by the clock
/// that collections have (data/clock/frame_clock.h); frames whose time is uncertain by more than kTrustedS,
/// because the host or the board stood still, are left out, and metadata left_out_frames counts them.
class PictureLog {
 public:
  /// Throws FileError when the file cannot be made there, or exists and is not to be replaced.
  PictureLog(OutputPath output, const PictureFormat& format);
  ~PictureLog();
  PictureLog(const PictureLog&) = delete;
  PictureLog& operator=(const PictureLog&) = delete;
  /// Throws FileError; where there is room for no more than writing what it has, write() still can.
  void add(const LiveFrame& seen);
  /// Writes the file, atomically. Throws FileError, again when add() has.
  void write(std::map<std::string, std::string> metadata);
  /// Frames that write() left out.
  std::uint64_t left_out() const { return left_out_; }
  /// Nothing was added, and write() makes no file.
  bool empty() const { return times_.empty(); }
  static constexpr double kTrustedS = 0.03;  ///< in which a finger of 10 mm/s goes 0.3 mm

 private:
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  using Spool = std::unique_ptr<std::FILE, Close>;
  /// A tensor whose rows wait in a temporary file.
  struct Column {
    const char* name;
    std::vector<std::uint64_t> row;  // its shape
    std::span<const float> LiveFrame::*values;
    Spool spool;
  };

  void add_column(const char* name, std::vector<std::uint64_t> row,
                  std::span<const float> LiveFrame::*values);
  void check_room(std::uint64_t row_bytes);
  std::vector<double> dated_times(std::vector<bool>& kept) const;
  void read_back(const Column& column, const std::vector<bool>& kept, const ByteSink& sink);
  [[noreturn]] void fail();

  OutputPath output_;
  PictureFormat format_;
  std::vector<Column> columns_;
  std::vector<double> times_;
  std::vector<float> distances_;
  std::vector<FrameArrival> arrivals_;  // of a recording of a board
  std::uint64_t left_out_ = 0;
  std::uint64_t bytes_ = 0, checked_bytes_ = 0;  // of the file, so far
  double began_s_ = NAN;                         // LiveFrame::wall_s of LiveFrame::time_s 0
  std::string problem_;                          // of a write that failed: what was kept is not whole
};

/// Recordings of the signals in the current folder, which train as those of --record do, started and stopped
/// from one thread and fed from another, which never waits for a file to be completed.
class Recorder {
 public:
  Recorder(const PictureFormat& format, std::map<std::string, std::string> metadata)
      : format_(format), metadata_(std::move(metadata)) {}
  ~Recorder() { finish(); }
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  // These answer with a line for people.
  std::string start();
  std::string stop();
  /// Stops, and waits until the last file is written; empty when there was none.
  std::string finish();
  /// Of the stream's thread: nothing unless it is recording. When the disk is full a recording ends and is
  /// written.
  void add(const LiveFrame& seen);

  struct Status {
    std::string recording;  ///< name of the file under way; empty: none
    double seconds = 0;     ///< of it
    std::string said;       ///< what became of the last one
  };
  Status status();

 private:
  std::string close(const std::string& why);  // under log_mutex_: a thread writes it; what that says

  PictureFormat format_;
  std::map<std::string, std::string> metadata_;
  // Two, so that the stream's thread never waits for one that is asked how things stand, 30 times a second
  // and with no hurry: log_mutex_ is otherwise held for a moment at a start and a stop only.
  std::mutex log_mutex_;  // of log_, begin_s_ and writing_
  std::unique_ptr<PictureLog> log_;
  double begin_s_ = -1;
  std::atomic<double> seconds_ = 0;
  std::mutex mutex_;  // of status_
  Status status_;
  std::future<void> writing_;  // of the last one
  std::string taken_;          // of what is written: the file got another name, and why
};

}  // namespace supertac
