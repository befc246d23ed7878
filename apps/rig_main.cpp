// supertac-rig: a virtual rig behind two pseudo-terminals, for everyone without the real one.

#include <unistd.h>

#include "apps/common/command_line/program.h"
#include "apps/common/running/signals.h"
#include "data/recordings/finger_model.h"
#include "hardware/virtual_rig/pty_rig.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

Firmware firmware_named(const std::string& name) {
  if (name == "marlin") return Firmware::marlin;
  if (name == "marlin-2.1.1") return Firmware::marlin_before_2_1_2;
  if (name == "klipper") return Firmware::klipper;
  throw std::invalid_argument("expected marlin, marlin-2.1.1 or klipper, got " + in_quotes(name));
}

RigSettings read_settings(const Arguments& arguments) {
  const auto seed = static_cast<std::uint64_t>(arguments.integer("seed", 0, 1'000'000'000));
  SimulatorSettings simulator;
  // The board does what it does.
  simulator.with_adc = simulator.with_saturation = false;
  simulator.filter_s = 0;
  simulator.drift_volts_per_s = 0;  // grows with the clock, and a rig may run for days
  const FingerIdentity identity{.seed = seed, .trial = static_cast<int>(arguments.integer("trial", 1, 1000))};
  const Plate plate = read_option("plate", [&] { return Plate::named(arguments.text("plate")); });
  const FingerModel finger(plate, simulator, identity);
  RigSettings settings;
  settings.seed = seed;
  settings.faults = RigFaults::mixed(arguments.number("faults", 0, 0.1));
  settings.chunk_s = 1e-3 * arguments.number("chunk", 0, 1000);
  settings.printer.firmware =
      read_option("firmware", [&] { return firmware_named(arguments.text("firmware")); });
  settings.board.signals = [finger](double x, double y, double z, double t) {
    const auto volts =
        finger.volts({x - rig::kPlate.x, y - rig::kPlate.y, z - rig::kPlate.z + finger.slide_z_mm()}, t);
    std::array<double, kTaxels> frame{};
    std::copy_n(volts.begin(), frame.size(), frame.begin());
    return frame;
  };
  return settings;
}

}  // namespace

void declare(Arguments& arguments) {
  arguments
      .required("plate", "NAME",
                "plate under the finger (3_Bumps, ..., plain, kind and pitch: ridges6, or FILE.stl)")
      .required("board-link", "PATH", "where to link the board's pseudo-terminal")
      .required("printer-link", "PATH", "where to link the printer's pseudo-terminal")
      .option("speedup", "X", "time of the rig per time of the wall; give the host the same", "1")
      .option("faults", "RATE", "faults per byte (0.002 is a bad cable), other faults in proportion", "0")
      .option("firmware", "NAME", "of the printer: marlin, marlin-2.1.1 (older rules) or klipper", "marlin")
      .option("chunk", "MS", "an adapter hands the board's bytes on every 2 ms to so long; 0: at once", "0")
      .option("trial", "N", "which finger: gains differ from trial to trial", "1")
      .option("seed", "N", "the same seed gives the same finger and the same faults", "1");
}

int run(Arguments& arguments) {
  const PtyRig rig(read_settings(arguments), arguments.text("board-link"), arguments.text("printer-link"),
                   arguments.number("speedup", 0.1, 100));
  arguments.print("ready");
  fflush(stdout);
  while (!interrupted()) usleep(50'000);
  return kExitOk;
}

}  // namespace supertac
