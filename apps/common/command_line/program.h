// What all programs share. A program is a file JOB_main.cpp that defines
//   void declare(Arguments&);  its options
//   int run(Arguments&);       its work; returns the exit code
// in namespace supertac, and a line of apps/CMakeLists.txt with its name and purpose, by which main()
// (main.cpp) runs it and `supertac` lists it.
#pragma once

#include <string>
#include <string_view>
#include <utility>

#include "apps/common/command_line/arguments.h"

namespace supertac {

constexpr int kExitOk = 0, kExitFailed = 1, kExitUsage = 2;

struct Program {
  std::string name;     ///< "supertac-simulate"
  std::string purpose;  ///< one sentence for --help
  void (*declare)(Arguments&);
  int (*run)(Arguments&);
  /// Of programs that compute: the name of the kernels that were chosen on this processor, and whether they
  /// do fused multiply-add in software; nullptr: none.
  std::pair<std::string_view, bool> (*kernels)() = nullptr;
};

/// The whole of main(): parses, handles --help and --version, sets the number of threads, catches signals,
/// refuses an existing --json file without --force, runs, and turns every error into one line on stderr.
/// Returns run()'s code; 1 when something failed; 2 when the command line was wrong; 128 + signal (130, 143)
/// when interrupted.
int run_program(const Program& program, int argc, const char* const* argv);

/// The commit the program was built from, "-dirty" when the tree had changes; "unknown" without git. Defined
/// in a file that the build writes.
const char* commit();
/// "0.2.0"
std::string version();

}  // namespace supertac
