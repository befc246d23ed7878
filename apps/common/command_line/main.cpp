// main() of every program: parses, handles --help and --version, sets the number of threads, catches signals,
// refuses outputs that cannot be written, runs, and turns every error into one line on stderr.
#include "apps/common/command_line/program.h"

#include <fcntl.h>
#include <omp.h>
#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <latch>
#include <new>
#include <system_error>
#include <thread>
#include <vector>

#include "apps/common/output/provenance.h"
#include "apps/common/running/signals.h"
#include "io/files/file.h"
#include "io/numbers/text.h"

namespace supertac {

// In a source that apps/CMakeLists.txt writes for each program: "supertac-simulate", one sentence for --help,
// and, of programs that compute, the name of the kernels that were chosen on this processor and whether they
// do fused multiply-add in software.
extern const char *program_name, *program_purpose;
extern std::pair<std::string_view, bool> (*program_kernels)();

namespace {

namespace fs = std::filesystem;

#ifdef __clang__
constexpr const char* kCompiler = "";  // it names itself
#else
constexpr const char* kCompiler = "GCC ";
#endif

/// One line, whatever the message holds.
int fail(std::string message, int code) {
  for (char& c : message)
    if (static_cast<unsigned char>(c) < ' ' || c == 0x7F) c = c == '\n' ? ' ' : '?';
  std::cerr << program_name + (": " + message + "\n");
  return code;
}

// OpenMP would end the program, with a line of its own, where it cannot start its threads.
void check_threads(int count) {
  std::string problem;
  std::latch all_are_there(1);
  std::vector<std::jthread> threads;
  threads.reserve(static_cast<std::size_t>(count));
  try {
    while (std::ssize(threads) + 1 < count) threads.emplace_back([&] { all_are_there.wait(); });
  } catch (const std::system_error& error) {
    problem = error.code().message();
  } catch (...) {
    all_are_there.count_down();  // else those that wait would be waited for
    throw;
  }
  all_are_there.count_down();
  if (problem.empty()) return;
  throw std::runtime_error(
      "cannot start " + std::to_string(count) + " threads: " + problem + " after " +
      std::to_string(threads.size() + 1) +
      "; pass fewer with --threads, or raise the limits of processes and memory (ulimit -u, -v)");
}

// By inode, or by name where they do not exist yet.
bool are_one_file(const std::string& a, const std::string& b) {
  std::error_code error;
  const fs::path one = fs::weakly_canonical(fs::absolute(a), error);
  return fs::equivalent(a, b, error) || (!one.empty() && one == fs::weakly_canonical(fs::absolute(b), error));
}

bool is_folder(const std::string& path) {
  std::error_code error;
  return fs::is_directory(path, error);
}

// An existing file of an input folder that an output would replace.
bool lies_in(const std::string& file, const std::string& folder) {
  std::error_code error;
  if (!fs::is_regular_file(file, error) || !is_folder(folder)) return false;
  const fs::path inside = fs::relative(file, folder, error);
  return !error && !inside.empty() && *inside.begin() != "..";
}

void check_folder(const std::string& path) {
  std::error_code error;
  fs::path there = fs::absolute(path, error);
  while (!fs::exists(fs::symlink_status(there, error)) && there.has_parent_path() &&
         there != there.parent_path()) {
    if (error && error.value() != ENOENT)
      throw FileError(path, "cannot be made: " + error.message() + "; choose another name");
    there = there.parent_path();
  }
  if (!is_folder(there.string()))
    throw FileError(path, there.string() + " is not a folder, expected one; choose another place");
  if (::access(there.c_str(), W_OK | X_OK) != 0)
    throw FileError(path, "the folder " + there.string() + " cannot be written; choose another place");
}

// Throws UsageError when two of the outputs are one file, or an output is one of the inputs or lies among
// them; FileError when one cannot be written where it shall be: before the work begins.
void check_outputs(const Arguments& arguments) {
  const std::vector<NamedPath> paths = arguments.paths();
  for (const NamedPath& output : paths) {
    if (!output.is_output) continue;
    for (const NamedPath& other : paths) {
      if (&other == &output) continue;
      if (!are_one_file(output.path, other.path) && (other.is_output || !lies_in(output.path, other.path)))
        continue;
      throw UsageError("--" + output.option + ": " + in_quotes(output.path) + " would overwrite " +
                       (other.is_output ? "the output of --" : "the input of --") + other.option +
                       "; choose another name");
    }
  }
  for (const NamedPath& output : paths) {
    if (!output.is_output) continue;
    if (output.is_folder) {
      check_folder(output.path);
    } else {
      refuse_existing(output.path, arguments.force());
      // Opens a temporary beside it and removes it: the name and the permission, tried.
      const AtomicFile trial(output.path);
    }
  }
}

// Opens /dev/null where descriptors 0 to 2 are closed: a port opened later would otherwise get one of these
// numbers, and a message would be sent to the device behind it.
void open_standard_descriptors() {
  for (int file = 0; file <= 2; ++file) {
    // The lowest number that is free, which is this one.
    if (::fcntl(file, F_GETFD) < 0 && errno == EBADF) (void)::open("/dev/null", O_RDWR);
  }
}

std::string version_text() {
  std::string text = std::string(program_name) + " " + version() + "\ncommit    " + commit() +
                     "\ncompiler  " + kCompiler + __VERSION__ + "\n";
  if (program_kernels != nullptr)
    text += "kernels   " + std::string(program_kernels().first) +
            " (SUPERTAC_ISA=avx512|avx2|neon|portable|plain overrides)\n";
  return text;
}

int parse_and_run(int argc, const char* const* argv) {
  Arguments arguments(program_name, program_purpose);
  declare(arguments);
  arguments.parse(argc, argv);
  const bool help = arguments.given("help");
  if (help || arguments.given("version")) {
    std::cout << (help ? arguments.help() : version_text());
    return kExitOk;
  }
  check_threads(arguments.threads());
  omp_set_num_threads(arguments.threads());
  catch_signals();
  check_outputs(arguments);
  begin_provenance(arguments);
  if (program_kernels != nullptr && program_kernels().second)
    std::cerr << program_name + std::string(
                                    ": this processor has no fused multiply-add: results are the same, but "
                                    "computing takes many times longer\n");
  const int code = run(arguments);
  if (interrupted()) return 128 + interrupting_signal();
  return code == kExitOk && arguments.displaced() ? kExitFailed : code;
}

int catch_all(int argc, const char* const* argv) {
  try {
    return parse_and_run(argc, argv);
  } catch (const Interrupted&) {
    return fail("stopped by signal " + std::to_string(interrupting_signal()), 128 + interrupting_signal());
  } catch (const UsageError& error) {
    return fail(std::string(error.what()) + " (see --help)", kExitUsage);
  } catch (const std::bad_alloc&) {
    return fail("out of memory; close other programs or ask for less", kExitFailed);
  } catch (const std::filesystem::filesystem_error& error) {
    return fail(
        error.path1().string() + ": cannot be used: " + error.code().message() + "; choose another name",
        kExitFailed);
  } catch (const std::system_error& error) {
    return fail("cannot start a thread: " + error.code().message() +
                    "; raise the limits of processes and memory (ulimit -u, -v)",
                kExitFailed);
  } catch (const nlohmann::json::exception& error) {
    const std::string what = error.what();  // "[json.exception.type_error.302] ..."
    return fail("settings in a file or a name are not as expected: " + what.substr(what.find("] ") + 2) +
                    "; is it the right file, is its name UTF-8?",
                kExitFailed);
  } catch (const std::exception& error) {
    // Whatever a signal cut short, such as a wait for a host, fails because of it.
    const int signal = interrupting_signal();
    return signal == 0
               ? fail(error.what(), kExitFailed)
               : fail("stopped by signal " + std::to_string(signal) + "; " + error.what(), 128 + signal);
  }
}

}  // namespace

}  // namespace supertac

int main(int argc, char** argv) {
  using namespace supertac;
  open_standard_descriptors();
  const int code = catch_all(argc, argv);
  std::cout.flush();
  if (!std::cout.fail() || code != kExitOk) return code;
  // Whoever pipes into head wants no more, and no line about it; the code is that of other programs.
  pollfd out{STDOUT_FILENO, POLLOUT, 0};
  if (::poll(&out, 1, 0) == 1 && (out.revents & POLLERR) != 0) return 128 + SIGPIPE;
  return fail("stdout: cannot write; is the disk full?", kExitFailed);
}
