// A plug that is pulled, through the kernel's pseudo-terminals: a typed error, and where the finger is left.

#include <atomic>
#include <chrono>
#include <thread>

#include "hardware/ports/errors.h"
#include "hardware/ports/serial_port.h"
#include "tests/hardware/rig_support.h"
#include "tests/hardware/virtual_rig/rig_world.h"
#include "tests/support/test.h"

namespace supertac::unplug_run_test {

using Finger = PalpationOutcome::Finger;

enum class Plug { board, printer };

void sleep_for(double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }

void pull(FaultyPtyRig& rig, Plug plug) { plug == Plug::board ? rig.unplug_board() : rig.unplug_printer(); }

// Within which time each of 100 pulls is noticed stands in bench/results/rig/unplug.csv.
TEST(UnplugRun, AReaderNotices) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    for (const Plug plug : {Plug::board, Plug::printer}) {
      const TemporaryFolder folder;
      FaultyPtyRig rig(running_rig(), folder / "board", folder / "printer");
      SerialPort port(folder / (plug == Plug::board ? "board" : "printer"));
      std::thread puller([&] {
        sleep_for(0.05 * RandomStream(seed, 1).uniform(0));
        pull(rig, plug);
      });
      std::array<std::byte, 4096> buffer{};
      EXPECT_THROW(
          for (const double until = port.now() + 100; port.now() < until;)(void) port.read(buffer, until),
          PortUnplugged);
      puller.join();
    }
  }
}

// One pass over 20 mm that starts just above the plate; the plug is pulled at a random moment of it. With the
// printer still there the finger ends lifted, without it the note says to lift it by hand.
TEST(UnplugRun, ACollectionEndsWithATypedErrorAndTheFingerUp) {
  constexpr double kRunSeconds = 5.5;
  constexpr Point3 kOrigin{99.7, 101.17, 97.81};
  for (const Plug plug : {Plug::board, Plug::printer}) {
    const TemporaryFolder folder;
    FaultyPtyRig rig(running_rig({.head = kOrigin}), folder / "board", folder / "printer");
    RecorderSettings settings;
    settings.bed.plan.passes = 1;
    settings.bed.plan.slide = 20;
    settings.bed.origin = kOrigin;
    settings.journal = folder / "journal";
    settings.header = "unplug run";
    std::atomic<bool> ended{false};
    std::thread puller([&] {
      for (bool moves = false; !moves && !ended; sleep_for(1e-3))
        rig.with_world([&](RigWorld& world) { moves = world.printer().moving(world.now()); });
      sleep_for(kRunSeconds * RandomStream(1, 2).uniform(0));
      pull(rig, plug);
    });
    const PalpationOutcome outcome =
        record_palpation(std::make_unique<SerialPort>(folder / "board", SerialSettings{rig::kBoardBaud}),
                         std::make_unique<SerialPort>(folder / "printer", SerialSettings{115200}), settings)
            .outcome;
    ended = true;
    puller.join();
    Point3 head;
    rig.with_world([&](RigWorld& world) { head = world.printer().head(world.now()); });
    ASSERT_FALSE(outcome.complete);
    EXPECT_THROW(std::rethrow_exception(outcome.error), PortUnplugged);
    const bool up = head.z > settings.bed.plan.start.z + 4.9;
    if (plug == Plug::board)
      EXPECT_TRUE(up && outcome.finger == Finger::lifted) << outcome.note;
    else
      EXPECT_TRUE(up || outcome.note.find("by hand") != std::string::npos) << outcome.note;
  }
}

}  // namespace supertac::unplug_run_test
