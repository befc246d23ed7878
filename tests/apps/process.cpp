#include "tests/apps/process.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>

#include "io/file.h"
#include "tests/io/temporary_folder.h"

namespace supertac {
namespace {

void redirect(int target, const std::string& path) {
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  if (file < 0 || dup2(file, target) < 0) _exit(126);
}

void wait_for(const std::string& path) {
  for (int i = 0; i < 20'000 && !std::filesystem::exists(path); ++i) usleep(500);
}

}  // namespace

ProcessResult run_process(const std::string& program, const std::vector<std::string>& arguments,
                          const ProcessOptions& options) {
  TemporaryFolder folder;
  const std::string path = std::string(SUPERTAC_BIN) + "/" + program;
  std::vector<std::string> words = {path};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);

  const pid_t child = fork();
  if (child == 0) {
    redirect(STDOUT_FILENO, folder.file("out"));
    redirect(STDERR_FILENO, folder.file("error"));
    if (options.max_file_bytes >= 0) {
      const auto bytes = static_cast<rlim_t>(options.max_file_bytes);
      const rlimit limit{bytes, bytes};
      setrlimit(RLIMIT_FSIZE, &limit);
    }
    execv(argv[0], argv.data());
    _exit(127);
  }
  if (options.signal != 0) {
    wait_for(options.signal_when);
    kill(child, options.signal);
  }
  int status = 0;
  waitpid(child, &status, 0);
  ProcessResult result;
  result.code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  result.out = read_text_file(folder.file("out"), 1 << 26);
  result.error = read_text_file(folder.file("error"), 1 << 26);
  return result;
}

}  // namespace supertac
