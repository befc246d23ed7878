// rig_fault_runs [RUNS [FIRST_SEED]]: seeded collections on the virtual rig in simulated time, as DrawnRun
// draws them, one line of CSV each. Every recording is within 0.3 mm of the truth by frame number and named
// by its speed within 1 %, or says that it is not; no head leaves the plan's box. Then twelve programs of 60
// moves a firmware with 0.2 % of the bytes damaged. Exit code 1 when a promise is broken.
#include <cstdlib>
#include <iostream>

#include "tests/hardware/fault_run.h"
#include "tests/hardware/rig_support.h"

namespace supertac {
namespace {

/// 60 moves that must run once, in order, and end at X = 30.
bool program_ends_right(std::uint64_t seed, Firmware firmware) {
  RigSettings rig = running_rig({.firmware = firmware}, {.byte_rate = 0.002});
  rig.seed = seed;
  SimulatedRig simulated(rig);
  const auto port = simulated.printer_port();
  std::vector<std::string> moves;
  try {
    MarlinLink link(*port);
    link.connect();
    link.command("G92 X0 Y0 Z0");
    for (int i = 1; i <= 60; ++i) {
      moves.push_back("G1 X" + std::to_string(i == 60 ? 30 : i % 7) + " F3000");
      link.command(moves.back());
    }
    link.command("M400", 60);
  } catch (const HardwareError& error) {
    std::cerr << "program, seed " << seed << ": " << error.what() << '\n';
  }
  return moves.size() == 60 && moves_of(simulated.world().printer()) == moves;
}

int programs_that_end_right() {
  int right = 0;
  for (const Firmware firmware : {Firmware::marlin, Firmware::marlin_before_2_1_2})
    for (std::uint64_t seed = 1; seed <= 12; ++seed) right += program_ends_right(seed, firmware) ? 1 : 0;
  return right;
}

}  // namespace
}  // namespace supertac

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
  const int programs = programs_that_end_right();
  std::cerr << runs << " runs: " << complete << " complete, " << flagged << " flagged; the rest within "
            << worst << " mm; " << broken << " broken promises; " << programs
            << " of 24 programs of 60 moves\n";
  return broken == 0 && programs == 24 ? 0 : 1;
}
