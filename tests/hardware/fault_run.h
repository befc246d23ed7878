// One seeded collection on a faulty rig in simulated time, and whether it ended as promised.
#pragma once

#include <cstdint>
#include <string>

#include "hardware/collection/palpation_recorder.h"
#include "tests/hardware/simulated_rig.h"

namespace supertac {

struct FaultVerdict {
  bool complete = false;  ///< the run says "done"
  std::string broken;     ///< the promise that was broken; empty when all held
  std::string altered;    ///< a damaged move that Marlin's 8-bit XOR let through; no host can see it
  std::string error;      ///< of a run that was not complete
  double simulated_s = 0;
  MarlinLink::Counters printer;
  std::uint64_t frames = 0, missing = 0;
};

/// Runs the whole plan. Promises: complete with the head where it should be, every planned move run once and
/// in order, every frame accounted for as received or missing; or a typed error with the finger lifted or the
/// stop confirmed.
FaultVerdict run_faulty_collection(const RigFaults& faults, std::uint64_t seed, int passes);

}  // namespace supertac
