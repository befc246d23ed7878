// Recording at somebody's wish, while a stream runs.
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "apps/stream/picture_log.h"

namespace supertac {

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
  void complete(std::unique_ptr<PictureLog> log, std::string name, const std::string& why);

  PictureFormat format_;
  std::map<std::string, std::string> metadata_;
  // Two, so that the stream's thread never waits for one that is asked how things stand, 30 times a second
  // and with no hurry: log_mutex_ is otherwise held for a moment at a start and a stop only.
  std::mutex log_mutex_;  // of log_, begin_s_ and writers_
  std::unique_ptr<PictureLog> log_;
  double begin_s_ = -1;
  std::atomic<double> seconds_ = 0;
  std::mutex mutex_;  // of status_
  Status status_;
  std::vector<std::thread> writers_;  // under log_mutex_; joined by finish()
  std::mutex write_mutex_;            // of taken_
  std::string taken_;                 // of what complete() writes: the file got another name, and why
};

}  // namespace supertac
