#include "tests/hardware/unplug_run.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <thread>

#include "bench/studies/rig/stall_watch.h"
#include "hardware/collection/palpation_recorder.h"
#include "hardware/ports/errors.h"
#include "hardware/ports/serial_port.h"
#include "tests/hardware/rig_support.h"
#include "tests/hardware/virtual_rig/rig_world.h"

namespace supertac {
namespace {

constexpr double kRunSeconds = 5.5;  // a little less than the short plan below takes
constexpr Point3 kOrigin{99.7, 101.17, 97.81};

void sleep_for(double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }

/// What happened at a port, by the wall's clock.
struct Notes {
  double failed = 0;   ///< when it first did
  double held = 0;     ///< for which the kernel then kept the call beyond its deadline
  double stopped = 0;  ///< when a stop was first sent
};

class NotingPort : public Port {
  template <class Call>
  auto noting(double until, const Call& call) {
    const double begin = monotonic_seconds();
    try {
      return call();
    } catch (const PortUnplugged&) {
      const double end = monotonic_seconds();
      if (notes_.failed == 0) notes_.held = std::max(0.0, end - std::max(begin, until));
      if (notes_.failed == 0) notes_.failed = end;
      throw;
    }
  }

 public:
  NotingPort(const std::string& path, unsigned baud, Notes& notes) : port_(path, {baud}), notes_(notes) {}
  const std::string& name() const override { return port_.name(); }
  double now() override { return port_.now(); }
  Received read(std::span<std::byte> buffer, double until) override {
    return noting(until, [&] { return port_.read(buffer, until); });
  }
  double write(std::span<const std::byte> bytes, double until) override {
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    if (notes_.stopped == 0 && text.find("M410") != std::string_view::npos)
      notes_.stopped = monotonic_seconds();
    return noting(until, [&] { return port_.write(bytes, until); });
  }

 private:
  SerialPort port_;
  Notes& notes_;
};

/// When the plug began to be pulled, and how long the kernel took to hang the terminal up: it waits for
/// workers of usual priority, and before that there is nothing to be noticed.
struct Pull {
  double at_s = 0, took_s = 0;
};

Pull pull(FaultyPtyRig& rig, Plug plug) {
  const double begin = monotonic_seconds();
  plug == Plug::board ? rig.unplug_board() : rig.unplug_printer();
  return {begin, monotonic_seconds() - begin};
}

/// A collection of one pass over 20 mm that starts just above the plate.
RecorderSettings short_run(const TemporaryFolder& folder) {
  RecorderSettings settings;
  settings.bed.plan.passes = 1;
  settings.bed.plan.slide = 20;
  settings.bed.origin = kOrigin;
  settings.journal = folder / "journal";
  settings.header = "unplug run";
  return settings;
}

void judge(UnplugVerdict& verdict, Plug plug, const PalpationOutcome& outcome, const Point3& head,
           double contact_z) {
  using Finger = PalpationOutcome::Finger;
  verdict.finger = outcome.finger == Finger::lifted    ? "lifted"
                   : outcome.finger == Finger::stopped ? "stopped"
                                                       : "unknown";
  try {
    if (outcome.complete) throw std::logic_error("a false done");
    std::rethrow_exception(outcome.error);
  } catch (const PortUnplugged&) {
  } catch (const std::exception& error) {
    verdict.broken = std::string("expected PortUnplugged, found: ") + error.what();
    return;
  }
  const bool up = head.z > contact_z + 4.9;
  if (plug == Plug::board && (outcome.finger != Finger::lifted || !up)) {
    verdict.broken = "the finger was not lifted: " + outcome.note;
  } else if (plug == Plug::printer && !up && outcome.note.find("by hand") == std::string::npos) {
    verdict.broken = "nobody is told to lift the finger: " + outcome.note;
  }
}

}  // namespace

UnplugVerdict unplug_idle(Plug plug, std::uint64_t seed) {
  const TemporaryFolder folder;
  FaultyPtyRig rig(running_rig(), folder / "board", folder / "printer");
  SerialPort port(folder / (plug == Plug::board ? "board" : "printer"));
  UnplugVerdict verdict;
  verdict.moment_s = 0.05 * RandomStream(seed, 1).uniform(0);
  StallWatch stalls;
  Pull pulled;
  std::thread puller([&] {
    sleep_for(verdict.moment_s);
    pulled = pull(rig, plug);
  });
  try {
    std::array<std::byte, 4096> buffer{};
    for (const double until = port.now() + 100; port.now() < until;) (void)port.read(buffer, until);
    verdict.broken = "not noticed in 100 s";
  } catch (const PortUnplugged&) {
  }
  const double noticed = monotonic_seconds();
  puller.join();
  verdict.noticed_s = verdict.returned_s = noticed - pulled.at_s;
  verdict.hanging_up_s = pulled.took_s;
  verdict.stall_s = stalls.longest(pulled.at_s, noticed);
  return verdict;
}

UnplugVerdict unplug_in_collection(Plug plug, std::uint64_t seed) {
  const TemporaryFolder folder;
  FaultyPtyRig rig(running_rig({.head = kOrigin}), folder / "board", folder / "printer");
  UnplugVerdict verdict;
  verdict.moment_s = kRunSeconds * RandomStream(seed, 2).uniform(0);
  const RecorderSettings settings = short_run(folder);
  Notes board, printer;
  Pull pulled;
  StallWatch stalls;
  std::atomic<bool> ended{false};
  std::thread puller([&] {
    for (bool moves = false; !moves && !ended; sleep_for(1e-3)) {
      rig.with_world([&](RigWorld& world) { moves = world.printer().moving(world.now()); });
    }
    sleep_for(verdict.moment_s);
    pulled = pull(rig, plug);
  });
  try {
    const PalpationOutcome outcome =
        record_palpation(std::make_unique<NotingPort>(folder / "board", rig::kBoardBaud, board),
                         std::make_unique<NotingPort>(folder / "printer", 115200, printer), settings)
            .outcome;
    const double returned = monotonic_seconds();
    ended = true;
    puller.join();
    verdict.noticed_s = (plug == Plug::board ? printer.stopped : printer.failed) - pulled.at_s;
    verdict.returned_s = returned - pulled.at_s;
    verdict.hanging_up_s = std::max(pulled.took_s, (plug == Plug::board ? board : printer).held);
    verdict.stall_s = stalls.longest(pulled.at_s, pulled.at_s + verdict.noticed_s);
    Point3 head;
    rig.with_world([&](RigWorld& world) { head = world.printer().head(world.now()); });
    judge(verdict, plug, outcome, head, settings.bed.plan.start.z);
  } catch (const std::exception& error) {
    ended = true;
    puller.join();
    verdict.broken = std::string("thrown instead of told: ") + error.what();
  }
  return verdict;
}

}  // namespace supertac
