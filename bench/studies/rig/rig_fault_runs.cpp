// rig_fault_runs [RUNS [FIRST_SEED]]: seeded collections on the virtual rig in simulated time, both
// firmwares, one line of CSV each: damaged bytes, boards and printers that stand still, hosts that do,
// adapters that hand bytes on in chunks, and a tenth with nothing but chunks. Every recording is within 0.3
// mm of the truth by frame number, or says that it is not. Then twelve programs of 60 moves a firmware with
// 0.2 % of the bytes damaged. Exit code 1 when a promise is broken.
#include <cstdlib>
#include <iostream>

#include "io/numbers/random.h"
#include "tests/hardware/fault_run.h"
#include "tests/hardware/rig_support.h"

namespace supertac {
namespace {

template <std::size_t Count>
double one_of(const double (&values)[Count], const RandomStream& random, std::uint64_t at) {
  return values[random.bits(at) % Count];
}

RigSettings drawn(std::uint64_t seed, bool& only_chunks) {
  const RandomStream random(seed, 43);
  RigSettings rig = running_rig({.firmware = seed % 2 == 0 ? Firmware::marlin : Firmware::marlin_before_2_1_2,
                                 .realtime_position = random.bits(0) % 4 != 0});
  rig.seed = seed;
  rig.chunk_s = one_of({0, 0.002, 0.01, 0.03, 0.1}, random, 1);
  only_chunks = seed % 10 < 2;
  if (only_chunks) return rig;
  rig.faults.byte_rate = one_of({0, 0.0002, 0.001, 0.002}, random, 2);
  rig.faults.freeze_rate = one_of({0, 0, 0.0003}, random, 3);
  rig.faults.host_freeze_rate = one_of({0, 0.0003, 0.001}, random, 4);
  return rig;
}

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
  int complete = 0, flagged = 0, broken = 0, chunks = 0, chunks_flagged = 0;
  double worst = 0;
  std::cout << "seed,firmware,m114r,byte_rate,chunk_ms,freeze_rate,host_freeze_rate,complete,frames,missing,"
               "left_out,"
               "worst_mm,worst_trusted_mm,doubt,error,broken\n";
  for (std::uint64_t seed = first; seed < first + static_cast<std::uint64_t>(runs); ++seed) {
    bool only_chunks = false;
    const RigSettings rig = drawn(seed, only_chunks);
    const FaultVerdict verdict =
        run_faulty_collection(rig, {.passes = 1, .slide = 40}, {99.7, 101.17, 99.81});
    const bool is_flagged = !verdict.complete || !verdict.doubt.empty();
    complete += verdict.complete ? 1 : 0;
    flagged += is_flagged ? 1 : 0;
    broken += verdict.broken.empty() ? 0 : 1;
    chunks += only_chunks ? 1 : 0;
    chunks_flagged += only_chunks && is_flagged ? 1 : 0;
    worst = std::max(worst, verdict.worst_trusted_mm);
    std::cout << seed << (rig.printer.firmware == Firmware::marlin ? ",marlin," : ",marlin_before_2_1_2,")
              << rig.printer.realtime_position << ',' << rig.faults.byte_rate << ',' << 1e3 * rig.chunk_s
              << ',' << rig.faults.freeze_rate << ',' << rig.faults.host_freeze_rate << ','
              << verdict.complete << ',' << verdict.frames << ',' << verdict.missing << ','
              << verdict.left_out << ',' << verdict.worst_mm << ',' << verdict.worst_trusted_mm << ",\""
              << verdict.doubt << "\",\"" << verdict.error << "\",\"" << verdict.broken << '"' << std::endl;
  }
  const int programs = programs_that_end_right();
  std::cerr << runs << " runs: " << complete << " complete, " << flagged << " flagged, of " << chunks
            << " with nothing but chunks " << chunks_flagged << "; the rest within " << worst << " mm; "
            << broken << " broken promises; " << programs << " of 24 programs of 60 moves\n";
  return broken == 0 && programs == 24 ? 0 : 1;
}
