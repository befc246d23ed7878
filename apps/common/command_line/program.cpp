#include "apps/common/command_line/program.h"

#include <omp.h>

#include <chrono>
#include <filesystem>
#include <iostream>
#include <new>
#include <thread>

#include "apps/common/command_line/version.h"
#include "apps/common/output/outputs.h"
#include "apps/common/output/provenance.h"
#include "apps/common/running/launch.h"
#include "apps/common/running/signals.h"
#include "io/files/file.h"

namespace supertac {
namespace {

#ifdef __clang__
constexpr const char* kCompiler = "";  // it names itself
#else
constexpr const char* kCompiler = "GCC ";
#endif

// A mistake in the command line is made by all processes of an mpirun: when the first reports it, mpirun
// ends the others before they do.
std::string among_others() {
  const int rank = launch().rank;
  if (rank == 0) return "";
  if (!interrupted()) std::this_thread::sleep_for(std::chrono::milliseconds(400));
  return " (rank " + std::to_string(rank) + ")";
}

/// One line, whatever the message holds.
int fail(const Program& program, std::string message, int code) {
  const std::string rank = among_others();
  for (char& c : message)
    if (static_cast<unsigned char>(c) < ' ' || c == 0x7F) c = c == '\n' ? ' ' : '?';
  std::cerr << program.name + rank + ": " + message + "\n";
  return code;
}

int run(const Program& program, Arguments& arguments) {
  omp_set_num_threads(arguments.threads());
  catch_signals();
  check_outputs(arguments);
  begin_provenance(arguments);
  if (program.numerics != nullptr) {
    if (const std::string warning = program.numerics().warning; !warning.empty()) {
      std::cerr << program.name << ": " << warning << '\n';
    }
  }
  const int code = program.run(arguments);
  return interrupted() ? 128 + interrupting_signal() : code;
}

int parse_and_run(const Program& program, int argc, const char* const* argv) {
  Arguments arguments(program.name, program.purpose);
  program.declare(arguments);
  arguments.parse(argc, argv);
  if (arguments.given("help")) {
    std::cout << arguments.help();
  } else if (arguments.given("version")) {
    std::cout << version_text(program);
  } else {
    return run(program, arguments);
  }
  return kExitOk;
}

int catch_all(const Program& program, int argc, const char* const* argv) {
  try {
    return parse_and_run(program, argc, argv);
  } catch (const Interrupted&) {
    return fail(program, "stopped by signal " + std::to_string(interrupting_signal()),
                128 + interrupting_signal());
  } catch (const UsageError& error) {
    return fail(program, std::string(error.what()) + " (see --help)", kExitUsage);
  } catch (const std::bad_alloc&) {
    return fail(program, "out of memory; close other programs or ask for less", kExitFailed);
  } catch (const std::filesystem::filesystem_error& error) {
    return fail(
        program,
        error.path1().string() + ": cannot be used: " + error.code().message() + "; choose another name",
        kExitFailed);
  } catch (const nlohmann::json::exception& error) {
    const std::string what = error.what();  // "[json.exception.type_error.302] ..."
    return fail(program,
                "settings in a file or a name are not as expected: " + what.substr(what.find("] ") + 2) +
                    "; is it the right file, is its name UTF-8?",
                kExitFailed);
  } catch (const std::exception& error) {
    return fail(program, error.what(), kExitFailed);
  }
}

}  // namespace

int run_program(const Program& program, int argc, const char* const* argv) {
  open_standard_descriptors();
  const int code = catch_all(program, argc, argv);
  std::cout.flush();
  if (std::cout.fail() && code == kExitOk)
    return fail(program, "stdout: cannot write; has its reader gone, is the disk full?", kExitFailed);
  return code;
}

std::string version() { return SUPERTAC_VERSION; }

std::string version_text(const Program& program) {
  std::string text = program.name + " " + version() + "\ncommit    " + commit() + "\ncompiler  " + kCompiler +
                     __VERSION__ + "\n";
  if (program.numerics != nullptr) text += program.numerics().text;
  return text;
}

}  // namespace supertac
