// rig_fault_runs [RUNS [FIRST_SEED]]: seeded collections on the virtual rig in simulated time, as DrawnRun
// draws them, one line of CSV each. Every recording is within 0.3 mm of the truth by frame number and named
// by its speed within 1 %, or says that it is not; no head leaves the plan's box. Exit code 1 when a promise
// is broken.
#include <cstdlib>
#include <iostream>

#include "tests/hardware/fault_run.h"

int main(int argc, char** argv) {
  using namespace supertac;
  const int runs = argc > 1 ? std::atoi(argv[1]) : 1000;
  const std::uint64_t first = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1;
  int complete = 0, flagged = 0, broken = 0;
  double worst = 0;
  std::cout << "seed,firmware,m114r,byte_rate,chunk_ms,freeze_rate,host_freeze_rate,left_on,speed_percent,"
               "slowness,acceleration,speed,complete,compared,missing,left_out,named,worst_mm,"
               "worst_trusted_mm,doubt,error,broken\n";
  for (std::uint64_t seed = first; seed < first + static_cast<std::uint64_t>(runs); ++seed) {
    const DrawnRun run(seed);
    const FaultVerdict verdict = run_faulty_collection(run.rig, run.plan, run.origin);
    const bool is_flagged = !verdict.complete || !verdict.doubt.empty();
    complete += verdict.complete ? 1 : 0;
    flagged += is_flagged ? 1 : 0;
    broken += verdict.broken.empty() ? 0 : 1;
    worst = std::max(worst, verdict.worst_trusted_mm);
    const RigSettings& rig = run.rig;
    const VirtualPrinterSettings& printer = rig.printer;
    std::cout << seed << ',' << static_cast<int>(printer.firmware) << ',' << printer.realtime_position << ','
              << rig.faults.byte_rate << ',' << 1e3 * rig.chunk_s << ',' << rig.faults.freeze_rate << ','
              << rig.faults.host_freeze_rate << ',' << (printer.left_over != LeftOver{}) << ','
              << printer.left_over.speed_percent << ',' << printer.slowness << ',' << printer.acceleration
              << ',' << run.plan.speed << ',' << verdict.complete << ',' << verdict.compared << ','
              << verdict.missing << ',' << verdict.left_out << ',' << verdict.named_mm_s << ','
              << verdict.worst_mm << ',' << verdict.worst_trusted_mm << ",\"" << verdict.doubt << "\",\""
              << verdict.error << "\",\"" << verdict.broken << '"' << std::endl;
  }
  std::cerr << runs << " runs: " << complete << " complete, " << flagged << " flagged; the rest within "
            << worst << " mm; " << broken << " broken promises\n";
  return broken == 0 ? 0 : 1;
}
