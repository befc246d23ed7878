#include "tests/apps/common/process.h"

#include <fcntl.h>
#include <stdlib.h>
#include <sys/ioctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <iterator>
#include <sstream>

#include "io/files/file.h"

namespace supertac {
namespace {

void redirect(int target, const std::string& path, int flags) {
  const int file = open(path.c_str(), O_WRONLY | flags, 0600);
  if (file < 0 || dup2(file, target) < 0) _exit(126);
}

int open_terminal() {
  const int terminal = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (terminal < 0 || grantpt(terminal) != 0 || unlockpt(terminal) != 0)
    throw std::runtime_error("cannot open a pseudo-terminal");
  winsize size{};
  size.ws_col = 100;
  ioctl(terminal, TIOCSWINSZ, &size);
  return terminal;
}

}  // namespace

RunningProcess::RunningProcess(const std::string& program, const std::vector<std::string>& arguments,
                               const ProcessOptions& options) {
  const std::string path = program.starts_with("/") ? program : std::string(SUPERTAC_BIN) + "/" + program;
  std::vector<std::string> words = {path};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  std::string error = folder_.file("error");
  if (options.terminal) {
    terminal_ = open_terminal();
    error = ptsname(terminal_);
  }
  child_ = fork();
  if (child_ != 0) return;
  redirect(STDOUT_FILENO, folder_.file("out"), O_CREAT | O_TRUNC);
  redirect(STDERR_FILENO, error, options.terminal ? O_NOCTTY : O_CREAT | O_TRUNC);
  if (options.terminal) setenv("TERM", "vt100", 1);
  if (!options.folder.empty() && chdir(options.folder.c_str()) != 0) _exit(126);
  if (options.max_file_bytes >= 0) {
    const auto bytes = static_cast<rlim_t>(options.max_file_bytes);
    const rlimit limit{bytes, bytes};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  execv(argv[0], argv.data());
  _exit(127);
}

RunningProcess::~RunningProcess() {
  if (child_ > 0) {
    kill(child_, SIGKILL);
    waitpid(child_, nullptr, 0);
  }
  if (terminal_ >= 0) close(terminal_);
}

bool RunningProcess::ended() const {
  siginfo_t state{};
  return child_ < 0 || (waitid(P_PID, static_cast<id_t>(child_), &state, WEXITED | WNOHANG | WNOWAIT) == 0 &&
                        state.si_pid == child_);
}

void RunningProcess::send(int signal) const { kill(child_, signal); }

void RunningProcess::read_terminal() {
  char bytes[512];
  for (ssize_t count; (count = read(terminal_, bytes, sizeof bytes)) > 0;)
    shown_.append(bytes, static_cast<std::size_t>(count));
}

ProcessResult RunningProcess::wait() {
  int status = 0;
  while (waitpid(child_, &status, terminal_ >= 0 ? WNOHANG : 0) == 0) {
    read_terminal();
    usleep(2000);
  }
  child_ = -1;
  if (terminal_ >= 0) read_terminal();
  ProcessResult result;
  result.code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  result.out = read_text_file(folder_.file("out"), 1 << 26);
  result.error = terminal_ >= 0 ? shown_ : read_text_file(folder_.file("error"), 1 << 26);
  return result;
}

static ProcessResult end_of(RunningProcess& process, const ProcessOptions& options) {
  if (options.signal != 0) {
    wait_for_file(options.signal_when);
    process.send(options.signal);
  }
  return process.wait();
}

ProcessResult run_process(const std::string& program, const std::vector<std::string>& arguments,
                          const ProcessOptions& options) {
  RunningProcess process(program, arguments, options);
  return end_of(process, options);
}

RunningProcess start_in(const std::string& folder, const std::string& line, ProcessOptions options) {
  std::istringstream text(line);
  std::string program;
  text >> program;
  options.folder = folder;
  return {program, {std::istream_iterator<std::string>(text), {}}, options};
}

ProcessResult run_in(const std::string& folder, const std::string& line, ProcessOptions options) {
  RunningProcess process = start_in(folder, line, options);
  return end_of(process, options);
}

static bool has_files(const std::string& folder) {
  std::error_code gone;  // a program may be at work there
  for (std::filesystem::recursive_directory_iterator entry(folder, gone), end; !gone && entry != end;
       entry.increment(gone))
    if (entry->is_regular_file(gone)) return true;
  return false;
}

void wait_for_file(const std::string& path, std::uintmax_t bytes) {
  const bool any = path.ends_with("/*");
  const auto there = [&] {
    if (any) return has_files(path.substr(0, path.size() - 2));
    std::error_code missing;
    if (bytes == 0) return std::filesystem::exists(path, missing);
    const std::uintmax_t size = std::filesystem::file_size(path, missing);
    return !missing && size >= bytes;
  };
  for (int i = 0; i < 240'000 && !there(); ++i) usleep(500);
}

void wait_for_growth(const std::string& path, std::uintmax_t bytes) {
  wait_for_file(path);
  wait_for_file(path, std::filesystem::file_size(path) + bytes);
}

}  // namespace supertac
