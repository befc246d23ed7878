// Runs one of the project's programs as a user would.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace supertac {

struct ProcessResult {
  int code = -1;  ///< exit code, or 128 + signal
  std::string out, error;
};

struct ProcessOptions {
  int signal = 0;  ///< sent once the file `signal_when` exists
  std::string signal_when{};
  long max_file_bytes = -1;  ///< limit on the size of files written; -1: none
};

/// `program` is a name in the build's bin folder, e.g. "supertac-info".
ProcessResult run_process(const std::string& program, const std::vector<std::string>& arguments,
                          const ProcessOptions& options = {});

}  // namespace supertac
