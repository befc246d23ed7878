// rig_fault_runs [RUNS [RATE [PASSES [mixed]]]]: seeded collections on a faulty rig, one line each that
// matters.
#include <cstdlib>
#include <iostream>
#include <string_view>

#include "tests/hardware/fault_run.h"

int main(int argc, char** argv) {
  using namespace supertac;
  const int runs = argc > 1 ? std::atoi(argv[1]) : 200;
  const double rate = argc > 2 ? std::atof(argv[2]) : 0.002;
  const int passes = argc > 3 ? std::atoi(argv[3]) : 8;
  const bool mixed = argc > 4 && std::string_view(argv[4]) == "mixed";
  const RigFaults faults = mixed ? RigFaults::mixed(rate) : RigFaults{.byte_rate = rate};
  int complete = 0, typed = 0, broken = 0;
  std::uint64_t frames = 0, missing = 0, repeats = 0;
  for (int seed = 1; seed <= runs; ++seed) {
    const FaultVerdict verdict = run_faulty_collection(faults, static_cast<std::uint64_t>(seed), passes);
    complete += verdict.complete ? 1 : 0;
    typed += !verdict.complete && verdict.broken.empty() ? 1 : 0;
    broken += verdict.broken.empty() ? 0 : 1;
    frames += verdict.frames;
    missing += verdict.missing;
    repeats += verdict.printer.repeats;
    if (!verdict.broken.empty()) std::cout << "seed " << seed << " BROKEN: " << verdict.broken << std::endl;
    if (!verdict.altered.empty())
      std::cout << "seed " << seed << " altered by two faults: " << verdict.altered << std::endl;
    if (!verdict.error.empty()) std::cout << "seed " << seed << ": " << verdict.error << std::endl;
  }
  std::cout << runs << " runs: " << complete << " complete, " << typed << " typed errors, " << broken
            << " broken promises; " << frames << " frames, " << missing << " missing, " << repeats
            << " repeated lines\n";
  return broken == 0 ? 0 : 1;
}
