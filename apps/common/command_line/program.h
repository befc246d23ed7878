// What all programs share. A program is a file JOB_main.cpp that defines declare() and run(), and a line of
// apps/CMakeLists.txt with its name and purpose, by which main() (main.cpp) runs it and `supertac` lists it.
#pragma once

#include "apps/common/command_line/arguments.h"

namespace supertac {

constexpr int kExitOk = 0, kExitFailed = 1, kExitUsage = 2;

/// The program's options.
void declare(Arguments& arguments);
/// Its work. Returns the exit code, which is 128 + signal (130, 143) when it is interrupted. What it throws
/// is code 2 where the command line was wrong (UsageError), else 1.
int run(Arguments& arguments);

}  // namespace supertac
