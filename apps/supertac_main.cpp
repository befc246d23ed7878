// supertac JOB ...: lists and runs the programs supertac-JOB that lie next to it.

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <vector>

#include "apps/common/command_line/nearest.h"
#include "apps/common/command_line/program.h"
#include "apps/common/output/outputs.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

struct Job {
  std::string name, purpose;
};

const std::vector<Job> kJobs = {
#include "programs.inc"
};

constexpr const char* kGlossary =
#include "glossary.inc"
    ;

void print_help() {
  std::cout << "Tactile super-resolution: one program per job.\n\nUsage:\n  supertac JOB [options]\n"
               "  supertac help JOB\n  supertac help glossary   explains taxel, window, latent, SSIM and the "
               "others\n\n";
  for (const Job& job : kJobs) std::cout << "  " << left_aligned(job.name, 12) << job.purpose << '\n';
}

int fail(const std::string& problem, int code) {
  std::cerr << "supertac: " << problem << '\n';
  return code;
}

int run_job(const std::string& name, char** argv) {
  std::vector<std::string> names;
  for (const Job& job : kJobs) names.push_back(job.name);
  if (std::find(names.begin(), names.end(), name) == names.end()) {
    const std::string hint = nearest_name(name, names);
    return fail("unknown job " + in_quotes(name) + (hint.empty() ? "" : "; did you mean '" + hint + "'?") +
                    " (supertac --help lists them)",
                kExitUsage);
  }
  std::error_code error;
  const auto folder = std::filesystem::read_symlink("/proc/self/exe", error).parent_path();
  if (error) return fail("cannot find its own folder: " + error.message(), kExitFailed);
  std::string program = folder / ("supertac-" + name);
  argv[1] = program.data();
  ::execv(argv[1], argv + 1);
  return fail(program + ": cannot be run: " + std::strerror(errno), kExitFailed);
}

int show_help(const std::string& job) {
  std::string words[] = {"supertac", job, "--help"};
  char* argv[] = {words[0].data(), words[1].data(), words[2].data(), nullptr};
  return run_job(job, argv);
}

}  // namespace
}  // namespace supertac

int main(int argc, char** argv) {
  using namespace supertac;
  open_standard_descriptors();
  const std::string first = argc > 1 ? argv[1] : "";
  if (first == "--version") {
    std::cout << version_text({"supertac", "", nullptr, nullptr});
  } else if (first == "--help" || first == "-h" || first.empty() || (first == "help" && argc == 2)) {
    print_help();
  } else if (first == "help" && argc > 2) {
    const std::string about = argv[2];
    if (about != "glossary") return show_help(about);
    std::cout << kGlossary;
  } else {
    return run_job(first, argv);
  }
  return first.empty() ? kExitUsage : kExitOk;
}
