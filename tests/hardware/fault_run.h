// One seeded collection on a faulty rig in simulated time, and whether it ended as promised.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "tests/hardware/rig_support.h"

namespace supertac {

struct FaultVerdict {
  bool complete = false;  ///< the run says "done"
  std::string broken;     ///< the promise that was broken; empty when all held
  std::string error;      ///< of a run that was not complete
  bool realtime = true;   ///< M114 R
  std::uint64_t missing = 0, left_out = 0;
  std::uint64_t compared = 0;   ///< recorded frames whose position was compared with the truth
  std::string doubt;            ///< what the recordings say of themselves; "incomplete" where that is all
  double named_mm_s = 0;        ///< of the last pass
  double worst_mm = 0;          ///< how far a recorded frame is from where it was made, at worst
  double worst_trusted_mm = 0;  ///< the same of recordings without doubt
};

/// A rig and a plan by seed: three firmwares, what another job left on, damaged bytes up to 0.2 %, boards,
/// printers and hosts that stand still, adapters, other speeds and accelerations than ordered, displays that
/// stop or pause, resets. A fifth of the seeds: nothing but chunks of an adapter.
struct DrawnRun {
  explicit DrawnRun(std::uint64_t seed);
  RigSettings rig;
  PalpationPlan plan{.passes = 1, .slide = 40};
  Point3 origin{99.7, 101.17, 99.81};
};

/// Runs the whole plan on a rig whose frames carry their own number, by which they are compared with the
/// truth. Promises: complete with the head where it should be and every frame accounted for as received or
/// missing; or a typed error with the finger lifted or the stop confirmed. No recording is wrong by more than
/// kTrustedMm without saying so. `printer`: what the driver gets in the place of the printer's port.
using PortBetween = std::function<std::unique_ptr<Port>(std::unique_ptr<Port> printer)>;
FaultVerdict run_faulty_collection(const RigSettings& rig, const PalpationPlan& plan,
                                   const Point3& origin = rig::kMounted, const PortBetween& printer = {});

}  // namespace supertac
