#include "tests/apps/rig/collect_run.h"

#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <stdexcept>

#include "hardware/ports/serial_port.h"
#include "io/numbers/numbers.h"

namespace supertac {

// Under nohup, or in the background of a script, these are ignored, and so they would be by supertac-collect.
CollectRun::CollectRun(double speedup, const RigSettings& settings)
    : speedup_(speedup), rig_(settings, board(), printer(), speedup) {
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) std::signal(number, SIG_DFL);
  disk_ = (std::filesystem::temp_directory_path() / "supertac-collect-XXXXXX").string();
  if (mkdtemp(disk_.data()) == nullptr) throw std::runtime_error("cannot create " + disk_);
  out_ = disk_ + "/out";
  setenv("XDG_STATE_HOME", (disk_ + "/state").c_str(), 1);
}

CollectRun::~CollectRun() {
  std::error_code ignored;
  std::filesystem::remove_all(disk_, ignored);
}

RigSettings CollectRun::running() {
  RigSettings settings;
  settings.printer_running = true;
  return settings;
}

std::vector<std::string> CollectRun::arguments(const std::vector<std::string>& more) const {
  std::vector<std::string> words = {"--board",   board(),          "--printer", printer(),  "--plate",
                                    "3_Bumps",   "--out",          out_,        "--passes", "1",
                                    "--speedup", format(speedup_), "--yes",     "--quiet"};
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

ProcessResult CollectRun::collect(const std::vector<std::string>& more, const ProcessOptions& options) const {
  return run_process("supertac-collect", arguments(more), options);
}

Point3 CollectRun::head() {
  Point3 head;
  rig_.with_world([&](RigWorld& world) { head = world.printer().head(world.now()); });
  return head;
}

bool CollectRun::wait_for_contact(double seconds, const RunningProcess& program) {
  const double until = monotonic_seconds() + 60;
  while (head().z > kSlideZ + 0.5) {
    if (monotonic_seconds() > until || program.ended()) return false;
    usleep(1000);
  }
  usleep(static_cast<useconds_t>(1e6 * seconds / speedup_));
  return true;
}

void CollectRun::wait_for_rest() {
  for (bool moves = true; moves; usleep(1000)) {
    rig_.with_world([&](RigWorld& world) { moves = world.printer().moving(world.now()); });
  }
}

bool CollectRun::origin_unknown() const {
  return std::filesystem::exists(disk_ + "/state/supertac/origin-unknown" + printer());
}

std::string CollectRun::files() const {
  std::vector<std::string> names;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(out_, ignored)) {
    names.push_back(entry.path().filename().string());
  }
  std::sort(names.begin(), names.end());
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : " ") + name;
  return text;
}

bool is_one_line(const std::string& text) { return !text.empty() && text.find('\n') == text.size() - 1; }

}  // namespace supertac
