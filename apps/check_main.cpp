// supertac-check: what an auditor asks of this machine, of a file and of a training.
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <map>

#include "apps/check/check.h"
#include "apps/common/command_line/program.h"
#include "io/files/file.h"
#include "io/numbers/text.h"

namespace supertac {

void declare(Arguments& a) {
  a.positional("WHAT",
               "gradients: all of them against finite differences, in double precision; bits: the hashes "
               "that every processor has to give; machine: processor, disk, ports; udev: prints a rule that "
               "opens the ports of USB devices; file FILE [OTHER]: checksum, provenance, and whether OTHER "
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

const std::map<std::string, std::vector<std::string>> kReadBy = {
    {"FILE", {"file", "chain", "training", "step"}},
    {"OTHER", {"file", "chain"}},
    {"data", {"chain", "training", "step"}},
    {"picture", {"chain"}},
    {"segments", {"training"}},
    {"seed", {"training"}},
    {"step", {"step"}},
    {"operator", {"step"}},
    {"out", {"step"}}};

void need(const Arguments& a, const std::string& name) {
  if (!a.given(name)) throw UsageError(a.text("WHAT") + ": expected " + name + ", found none");
}

}  // namespace

int run(Arguments& a) {
  const std::string what =
      a.choice("WHAT", {"gradients", "bits", "machine", "udev", "file", "chain", "training", "step"});
  for (const auto& [name, of] : kReadBy)
    if (a.given(name) && std::ranges::find(of, what) == of.end())
      throw UsageError((name == "FILE" || name == "OTHER" ? in_quotes(a.text(name)) : "--" + name) +
                       ": nothing that " + what + " reads; leave it out");
  if (what == "gradients") return check_gradients(a);
  if (what == "bits") return check_bits(a);
  if (what == "machine") return check_machine(a);
  if (what == "udev") return print_udev_rule(a);
  need(a, "FILE");
  if (what == "file") return check_file(a);
  need(a, what == "chain" ? "OTHER" : "data");
  if (what == "chain") return check_chain(a);
  if (what == "training") return check_training(a);
  need(a, "step");
  return check_step(a);
}

}  // namespace supertac
