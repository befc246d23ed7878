// hostile mutants N SEED: N seeded mutants through every reader, in this process; build it with the preset
// asan. hostile files N SEED: N files that are valid and lie. hostile devices N SEED: N collections, in
// simulated time, with printers that lie, that another job left otherwise, that are stopped at their display,
// boards that send in bursts, and hosts that stall. One table of counts on stdout; exit 1 when anything was
// found. attack.py has the command lines and signals.
#include "tests/apps/hostile/hostile.h"

#include <iostream>
#include <sstream>

#include "tests/support/test.h"

namespace supertac {

std::string evil_value(const RandomStream& random, std::uint64_t at) {
  static const std::vector<std::string> values = [] {
    std::vector<std::string> all = {
        "", "x\ny", "\x1b[31mred", "\xff\xfe", std::string(300, 'x'), std::string(5000, 'y')};
    std::istringstream words(
        "0 -1 1 2 nan inf 1e308 1e-308 18446744073709551616 0x10 1,,2 , plain ridges6 ridges0.0000001 "
        "ridgesinf bumps-1 precious precious.stl data data/1 data/good model new new/er loop fifo empty link "
        "/dev/null /dev/zero /dev/full /proc/self/mem / . .. - -- $(touch${IFS}PWNED) `touch${IFS}PWNED` "
        "a;touch${IFS}PWNED q';system('touch${IFS}PWNED');x=' 4x4 16x16 window paper %s%n%x "
        "precious,precious");
    for (std::string word; words >> word;) all.push_back(word);
    return all;
  }();
  return values[random.bits(at) % values.size()];
}

}  // namespace supertac

int main(int argc, char** argv) {
  using namespace supertac;
  const std::string mode = argc == 4 ? argv[1] : "";
  const TemporaryFolder folder;
  Counts counts;
  if (mode == "mutants") {
    counts = mutants_of_readers(folder.path(), std::stoull(argv[2]), std::stoull(argv[3]));
  } else if (mode == "files") {
    counts = lying_files(folder.path(), std::stoull(argv[2]), std::stoull(argv[3]));
  } else if (mode == "devices") {
    counts = lying_devices(std::stoull(argv[2]), std::stoull(argv[3]));
  } else {
    std::cerr << "hostile: expected mutants|files|devices N SEED, found " << argc - 1 << " words\n";
    return 2;
  }
  std::uint64_t findings = 0;
  for (const char* name : {"broken promises", "slow mutants", "crashes", "raw exceptions"})
    findings += counts[name];
  for (const auto& [name, count] : counts) std::cout << name << ',' << count << '\n';
  return findings == 0 ? 0 : 1;
}
