// supertac-rig: a virtual rig behind two pseudo-terminals, for everyone without the real one.

#include <unistd.h>

#include "apps/common/command_line/program.h"
#include "apps/common/running/signals.h"
#include "data/simulation/simulator.h"
#include "hardware/virtual_rig/virtual_rig.h"

namespace supertac {
namespace {

FingerSignals finger_of(const Arguments& arguments) {
  SimulatorSettings simulator;
  // The board does what it does.
  simulator.with_adc = simulator.with_saturation = false;
  simulator.filter_s = 0;
  simulator.drift_volts_per_s = 0;  // grows with the clock, and a rig may run for days
  const Plate plate = read_option("plate", [&] { return Plate::named(arguments.text("plate")); });
  const FingerModel finger(plate, simulator);
  return [finger](double x, double y, double z, double t) {
    const auto volts =
        finger.volts({x - rig::kPlate.x, y - rig::kPlate.y, z - rig::kPlate.z + finger.slide_z_mm()}, t);
    TaxelVolts frame{};
    std::copy_n(volts.begin(), frame.size(), frame.begin());
    return frame;
  };
}

}  // namespace

void declare(Arguments& arguments) {
  arguments
      .required("plate", "NAME",
                "plate under the finger (3_Bumps, ..., plain, kind and pitch: ridges6, or FILE.stl)")
      .required("board-link", "PATH", "where to link the board's pseudo-terminal")
      .required("printer-link", "PATH", "where to link the printer's pseudo-terminal")
      .option("speedup", "X", "time of the rig per time of the wall; give the host the same", "1");
}

int run(Arguments& arguments) {
  const double speedup = arguments.number("speedup", 0.1, 100);
  const PtyRig rig(std::make_unique<PlainRig>(finger_of(arguments), PtyRig::now(speedup)),
                   arguments.text("board-link"), arguments.text("printer-link"), speedup);
  arguments.print("ready");
  fflush(stdout);
  while (!interrupted()) usleep(50'000);
  return kExitOk;
}

}  // namespace supertac
