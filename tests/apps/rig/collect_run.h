// A virtual rig in this process - so that a test can see where the head really is - and the real
// supertac-collect as another one.
#pragma once

#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <functional>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "hardware/ports/serial_port.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"
#include "tests/apps/common/process.h"
#include "tests/hardware/virtual_rig/rig_world.h"

namespace supertac {

constexpr double kSlideZ = 91.81;   ///< of the finger in contact
constexpr double kLiftedZ = 96.81;  ///< lowest z of a finger that was lifted

class CollectRun {
 public:
  /// Five times real time: a machine that stands still for 0.45 s is then a printer that answers none of nine
  /// M114 R, which a run rightly gives up on.
  explicit CollectRun(double speedup = 5, const RigSettings& settings = running())
      : speedup_(speedup), rig_(settings, board(), printer(), speedup) {
    // Under nohup, or in the background of a script, these are ignored, and so they would be by
    // supertac-collect.
    for (const int number : {SIGINT, SIGTERM, SIGHUP}) std::signal(number, SIG_DFL);
    disk_ = (std::filesystem::temp_directory_path() / "supertac-collect-XXXXXX").string();
    if (mkdtemp(disk_.data()) == nullptr) throw std::runtime_error("cannot create " + disk_);
    out_ = disk_ + "/out";
    setenv("XDG_STATE_HOME", (disk_ + "/state").c_str(), 1);
  }
  ~CollectRun() {
    std::error_code ignored;
    std::filesystem::remove_all(disk_, ignored);
  }
  CollectRun(const CollectRun&) = delete;
  CollectRun& operator=(const CollectRun&) = delete;

  static RigSettings running() {
    RigSettings settings;
    settings.printer_running = true;
    return settings;
  }
  /// A collection of one pass over 3_Bumps into out(), and `more`.
  std::string line(const std::string& more = "") const {
    return "supertac-collect --board " + board() + " --printer " + printer() +
           " --plate 3_Bumps --passes 1 --speedup " + format(speedup_) + " --yes --out " + out_ + " " + more;
  }
  RunningProcess start(const std::string& more = "--quiet") const { return start_in(disk_, line(more)); }
  /// The whole collection, to its end.
  ProcessResult collect(const std::string& more = "", const ProcessOptions& options = {}) const {
    return run_in(disk_, line("--quiet " + more), options);
  }

  FaultyPtyRig& rig() { return rig_; }
  Point3 head() {
    Point3 head;
    rig_.with_world([&](RigWorld& world) { head = world.printer().head(world.now()); });
    return head;
  }
  /// Waits until the head has been in contact for `seconds` of the rig's clock; false when it never is, or
  /// the program that moves it has ended.
  bool wait_for_contact(double seconds, const RunningProcess& program) {
    const double until = monotonic_seconds() + 60;
    while (head().z > kSlideZ + 0.5) {
      if (monotonic_seconds() > until || program.ended()) return false;
      usleep(1000);
    }
    usleep(static_cast<useconds_t>(1e6 * seconds / speedup_));
    return true;
  }
  /// A collection that does `then` once it has been in contact for three seconds, to its end.
  ProcessResult collect_until_contact(const std::function<void(RunningProcess&)>& then,
                                      const std::string& more = "--quiet") {
    RunningProcess program = start(more);
    EXPECT_TRUE(wait_for_contact(3, program));
    then(program);
    return program.wait();
  }
  /// Waits until the head stands; the finger of a program that was killed goes on to the end of its move.
  void wait_for_rest() {
    for (bool moves = true; moves; usleep(1000)) {
      rig_.with_world([&](RigWorld& world) { moves = world.printer().moving(world.now()); });
    }
  }
  double speedup() const { return speedup_; }
  const std::string& out() const { return out_; }
  /// Everything the program may write is below it: out(), and the state that outlives a run.
  const std::string& disk() const { return disk_; }
  /// The mark of a run that was cut off, when there is one.
  bool origin_unknown() const {
    return std::filesystem::exists(disk_ + "/state/supertac/origin-unknown" + printer());
  }
  std::string board() const { return folder_ / "board"; }
  std::string printer() const { return folder_ / "printer"; }
  std::string journal() const { return out_ + "/3_Bumps_t1_v10.journal"; }
  /// Names in out(), sorted, one a word.
  std::string files() const {
    std::set<std::string> names;
    std::error_code ignored;
    for (const auto& entry : std::filesystem::directory_iterator(out_, ignored))
      names.insert(entry.path().filename().string());
    return joined(names, " ");
  }

 private:
  TemporaryFolder folder_;
  double speedup_;
  FaultyPtyRig rig_;
  std::string disk_, out_;  // a real disk where there is one, not the memory of the other temporary folders
};

}  // namespace supertac
