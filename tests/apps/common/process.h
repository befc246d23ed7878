// Runs one of the project's programs as a user would.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>
#include <vector>

#include "tests/support/test.h"

namespace supertac {

struct ProcessResult {
  int code = -1;  ///< exit code, or 128 + signal
  std::string out, error;
};

struct ProcessOptions {
  int signal = 0;  ///< sent once the file `signal_when` exists; of "FOLDER/*" any file under it
  std::string signal_when{};
  long max_file_bytes = -1;  ///< limit on the size of files written; -1: none
  bool terminal = false;     ///< stderr is a terminal of 100 columns
  std::string folder{};      ///< where it runs; empty: where the test does
};

/// A program that runs beside the test; killed when the test ends first. `program` is a path or a name in the
/// build's bin folder, e.g. "supertac-info".
class RunningProcess {
 public:
  RunningProcess(const std::string& program, const std::vector<std::string>& arguments,
                 const ProcessOptions& options = {});
  ~RunningProcess();
  RunningProcess(const RunningProcess&) = delete;
  RunningProcess& operator=(const RunningProcess&) = delete;

  pid_t id() const { return child_; }
  void send(int signal) const;
  /// Whether it has ended; wait() says how.
  bool ended() const;
  ProcessResult wait();

 private:
  void read_terminal();

  TemporaryFolder folder_;
  pid_t child_ = -1;
  int terminal_ = -1;
  std::string shown_;
};

/// Starts it and waits for its end.
ProcessResult run_process(const std::string& program, const std::vector<std::string>& arguments,
                          const ProcessOptions& options = {});

/// The same of a command line such as "supertac-info m.safetensors" in a folder, whose files it names without
/// it. Spaces separate its words, and nothing quotes.
ProcessResult run_in(const std::string& folder, const std::string& line, ProcessOptions options = {});
RunningProcess start_in(const std::string& folder, const std::string& line, ProcessOptions options = {});

/// Waits up to two minutes, of a busy machine, for a file to appear and to have so many bytes.
void wait_for_file(const std::string& path, std::uintmax_t bytes = 0);
/// The same for it to become longer by `bytes`, as a program writes what it reads.
void wait_for_growth(const std::string& path, std::uintmax_t bytes);

}  // namespace supertac
