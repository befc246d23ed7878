// supertac-check: what an auditor asks of this machine, of a file and of a training.
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <set>

#include "apps/check/check.h"
#include "apps/common/command_line/program.h"
#include "io/files/file.h"
#include "io/numbers/text.h"

namespace supertac {

void declare(Arguments& a) {
  a.positional("WHAT",
               "gradients: all of them against finite differences, in double precision; bits: the hashes "
               "that every processor has to give; machine: processor, disk, ports; udev: prints a rule that "
               "opens the ports of USB devices; file FILE [OTHER]: checksum, content, and whether OTHER "
               "(recordings or a file) is what it was made from; chain FILE OTHER: whether model and "
               "recordings (--data) are those that the header OTHER of its C code states, and give that code "
               "and picture; training FILE --data DIR: repeats parts of a training that kept a ledger; step "
               "FILE --data DIR --step N: opens one step of it, with every operator");
  a.positional("FILE", "what is checked", false);
  a.positional("OTHER", "what it is compared with", false);
  a.option("data", "DIR", "training, step, chain: the recordings that the model was trained on");
  a.option("picture", "HEX", "chain: what the self-test said on the device, 16 digits");
  a.option("segments", "K", "training: how many of its twenty parts are repeated", "1");
  a.option("seed", "N", "training: draws them", "0");
  a.option("step", "N", "step: which one, from 1");
  a.option(
      "operator", "NAME",
      "step: the arrays of those whose name begins so are written to --out (3/ is the fourth micro-batch, "
      "update/ what the optimiser did)");
  a.option("out", "FILE", "step: arrays as safetensors, which examples/referee.py computes again with NumPy")
      .writes();
}

namespace {

// Double precision is a program of its own: one program cannot hold the same sources twice.
int check_gradients(const Arguments& a) {
  const std::string program =
      std::filesystem::read_symlink("/proc/self/exe").parent_path() / "supertac-check-gradients";
  std::vector<std::string> words{program};
  if (a.given("json")) words.insert(words.end(), {"--json", a.text("json")});
  for (const char* name : {"force", "quiet"})
    if (a.given(name)) words.push_back(std::string("--") + name);
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  ::execv(program.c_str(), pointers.data());
  throw FileError(program, std::string("cannot be run: ") + std::strerror(errno));
}

struct Job {
  const char* name;
  int (*run)(const Arguments&);
  std::vector<std::string> needs = {}, reads = {};
};
const std::vector<Job> kJobs = {{"gradients", check_gradients},
                                {"bits", check_bits},
                                {"machine", check_machine},
                                {"udev", print_udev_rule},
                                {"file", check_file, {"FILE"}, {"OTHER"}},
                                {"chain", check_chain, {"FILE", "OTHER"}, {"data", "picture"}},
                                {"training", check_training, {"FILE", "data"}, {"segments", "seed"}},
                                {"step", check_step, {"FILE", "data", "step"}, {"operator", "out"}}};

}  // namespace

int run(Arguments& a) {
  std::vector<std::string> names;
  std::set<std::string> read;  // by any
  for (const Job& job : kJobs) {
    names.emplace_back(job.name);
    read.insert(job.needs.begin(), job.needs.end()), read.insert(job.reads.begin(), job.reads.end());
  }
  const std::string what = a.choice("WHAT", names);
  const Job& job = *std::ranges::find(kJobs, what, &Job::name);
  for (const std::string& name : job.needs) read.erase(name);
  for (const std::string& name : job.reads) read.erase(name);
  for (const std::string& name : read)
    if (a.given(name))
      throw UsageError((name == "FILE" || name == "OTHER" ? in_quotes(a.text(name)) : "--" + name) +
                       ": nothing that " + what + " reads; leave it out");
  for (const std::string& name : job.needs)
    if (!a.given(name)) throw UsageError(what + ": expected " + name + ", found none");
  return job.run(a);
}

}  // namespace supertac
