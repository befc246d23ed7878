// supertac JOB ...: lists and runs the programs supertac-JOB that lie next to it.

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <map>
#include <vector>

#include "apps/common/nearest.h"
#include "apps/common/program.h"
#include "io/text.h"

namespace supertac {
namespace {

namespace fs = std::filesystem;
constexpr std::string_view kPrefix = "supertac-";

const std::map<std::string, std::string>& purposes() {
  static const std::map<std::string, std::string> kPurposes = {
      {"check", "looks at permissions, disk and kernels, and does a small same-bits run"},
      {"classify", "trains and tests the texture classifier"},
      {"collect", "records passes with the rig"},
      {"evaluate", "measures a model on recordings, beside the baselines"},
      {"import", "imports the rig's text recordings"},
      {"info", "prints what a file holds"},
      {"pairs", "writes recordings as pairs of images"},
      {"plate", "writes a plate as STL, and the palpation run as G-code"},
      {"rig", "a virtual board and printer"},
      {"simulate", "simulates recordings"},
      {"stream", "shows super-resolved pictures live"},
      {"sweep", "trains and measures a grid of settings"},
      {"train", "trains a model on recordings"}};
  return kPurposes;
}

std::vector<std::string> jobs_in(const fs::path& folder) {
  std::vector<std::string> jobs;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (name.starts_with(kPrefix) && ::access(entry->path().c_str(), X_OK) == 0 && !entry->is_directory()) {
      jobs.push_back(name.substr(kPrefix.size()));
    }
  }
  std::sort(jobs.begin(), jobs.end());
  return jobs;
}

void print_help(const std::vector<std::string>& jobs) {
  std::cout
      << "Tactile super-resolution: one program per job.\n\nUsage:\n  supertac JOB [options]\n  supertac JOB "
         "--help\n\n";
  for (const std::string& job : jobs) {
    const auto purpose = purposes().find(job);
    std::cout << "  " << job << std::string(job.size() < 12 ? 12 - job.size() : 1, ' ')
              << (purpose == purposes().end() ? "" : purpose->second) << '\n';
  }
}

int fail(const std::string& problem, int code) {
  std::cerr << "supertac: " << problem << '\n';
  return code;
}

int run_job(const fs::path& folder, const std::vector<std::string>& jobs, char** argv) {
  const std::string job = argv[1];
  if (std::find(jobs.begin(), jobs.end(), job) == jobs.end()) {
    const std::string hint = nearest_name(job, jobs);
    return fail("unknown job " + in_quotes(job) + (hint.empty() ? "" : "; did you mean '" + hint + "'?") +
                    " (supertac --help lists them)",
                kExitUsage);
  }
  const std::string program = (folder / (std::string(kPrefix) + job)).string();
  argv[1] = const_cast<char*>(program.c_str());  // execv does not write to it
  ::execv(program.c_str(), argv + 1);
  return fail(program + ": cannot be run: " + std::strerror(errno), kExitFailed);
}

}  // namespace
}  // namespace supertac

int main(int argc, char** argv) {
  using namespace supertac;
  std::error_code error;
  const fs::path folder = fs::read_symlink("/proc/self/exe", error).parent_path();
  if (error) return fail("cannot find its own folder: " + error.message(), kExitFailed);
  const auto jobs = jobs_in(folder);
  const std::string first = argc > 1 ? argv[1] : "";
  if (first == "--version") {
    std::cout << version_text({"supertac", "", nullptr, nullptr});
  } else if (first == "--help" || first == "-h") {
    print_help(jobs);
  } else if (first.empty()) {
    print_help(jobs);
    return kExitUsage;
  } else {
    return run_job(folder, jobs, argv);
  }
  return kExitOk;
}
