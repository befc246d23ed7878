// rig_unplug_runs [PULLS [OUT.csv]]: pulls the plug of each port PULLS times while idle and PULLS times
// in a collection.
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <iostream>

#include "tests/hardware/unplug_run.h"

int main(int argc, char** argv) {
  using namespace supertac;
  constexpr double kLatestS = 0.1;
  const int pulls = argc > 1 ? std::atoi(argv[1]) : 100;
  std::ofstream file(argc > 2 ? argv[2] : "/dev/null");
  file << "port,when,seed,moment_s,noticed_ms,stall_ms,hanging_up_ms,returned_ms,finger,broken\n";
  const bool terminal = isatty(STDERR_FILENO) == 1;
  int broken = 0;
  for (const Plug plug : {Plug::board, Plug::printer}) {
    for (const bool idle : {true, false}) {
      double worst = 0;
      for (int seed = 1; seed <= pulls; ++seed) {
        const auto number = static_cast<std::uint64_t>(seed);
        const UnplugVerdict v = idle ? unplug_idle(plug, number) : unplug_in_collection(plug, number);
        const bool late = v.late_s() > kLatestS;
        broken += v.broken.empty() && !late ? 0 : 1;
        worst = std::max(worst, v.late_s());
        file << (plug == Plug::board ? "board," : "printer,") << (idle ? "idle," : "collection,") << seed
             << ',' << v.moment_s << ',' << 1e3 * v.noticed_s << ',' << 1e3 * v.stall_s << ','
             << 1e3 * v.hanging_up_s << ',' << 1e3 * v.returned_s << ',' << v.finger << ',' << v.broken
             << (late ? " noticed late" : "") << std::endl;
        if (terminal)
          std::cerr << '\r' << (plug == Plug::board ? "board " : "printer ") << seed << '/' << pulls
                    << std::flush;
      }
      if (terminal) std::cerr << '\r';
      std::cout << (plug == Plug::board ? "board" : "printer") << (idle ? ", idle: " : ", in a collection: ")
                << pulls << " pulls, noticed after at most " << 1e3 * worst
                << " ms, stalls of the machine and of the kernel's hang-up deducted\n";
    }
  }
  std::cout << broken << " broken promises\n";
  return broken == 0 ? 0 : 1;
}
