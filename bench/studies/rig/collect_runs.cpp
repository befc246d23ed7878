// collect_runs COUNT [OUT.csv]: kills the real supertac-collect on a virtual rig at COUNT random moments, and
// recovers what it leaves.
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <string>

#include "bench/studies/rig/stall_watch.h"
#include "hardware/collection/collection.h"
#include "hardware/ports/errors.h"
#include "hardware/ports/serial_port.h"
#include "io/numbers/random.h"
#include "tests/apps/rig/collect_run.h"

namespace supertac {
namespace {

const std::string kRecording = "3_Bumps_t1_p1_v10.safetensors";

std::string without_line_ends(std::string text) {
  std::erase(text, '\n');
  return text;
}

struct Killed {
  double moment_s = 0;             ///< of the rig's clock, from the start of the program
  double lost_s = 0;               ///< of the rig's clock, from the newest record in the journal to the kill
  double stall_s = 0;              ///< of it, for which the machine itself stood still; allowed for
  double recorded_s = 0;           ///< from the first to the newest frame
  int frames = 0, recordings = 0;  ///< recovered
  std::string stage, broken;
};

double newest_time(const Journal& journal) {
  double newest = 0;
  for (const auto& [stream, records] : journal.streams) {
    if (!records.empty()) newest = std::max(newest, records.back().time_s);
  }
  return newest;
}

void recover(const CollectRun& run, const Journal& journal, Killed& killed) {
  for (const CollectedPass& pass : collection_of(journal).passes) {
    killed.frames += static_cast<int>(pass.time_s.size());
    killed.recordings += pass.time_s.size() >= 2 ? 1 : 0;
  }
  const std::string folder = run.out() + "/recovered";
  const ProcessResult result =
      run_process("supertac-import", {"--journal", run.journal(), "--out", folder, "--quiet"});
  const bool made = std::filesystem::exists(folder + "/" + kRecording);
  if (killed.recordings > 0 && (result.code != 0 || !made)) killed.broken = "not recovered: " + result.error;
  if (killed.recordings == 0 && (result.code != 1 || made || !is_one_line(result.error)))
    killed.broken = "nothing to recover, but: " + result.error;
}

/// The next start demands a confirmed origin when the head may have moved; when not, it never moved.
void start_again(CollectRun& run, Killed& killed) {
  if (!run.origin_unknown()) {
    if (distance(run.head(), rig::kMounted) > 0.01) killed.broken = "moved without a mark";
    return;
  }
  const ProcessResult result = run.collect();
  if (result.code != 1 || result.error.find("--confirm-origin") == std::string::npos ||
      !is_one_line(result.error))
    killed.broken = "the next start does not ask for the origin: " + result.error;
}

Killed kill_once(std::uint64_t seed) {
  constexpr double kSpeedup = 2, kRunSeconds = 32;
  Killed killed;
  killed.moment_s = kRunSeconds * RandomStream(seed, 5).uniform(0);
  StallWatch stalls;
  CollectRun run(kSpeedup);
  RunningProcess process("supertac-collect", run.arguments());
  usleep(static_cast<useconds_t>(1e6 * killed.moment_s / kSpeedup));
  const double killed_at = monotonic_seconds() * kSpeedup;  // the rig's clock
  process.send(SIGKILL);
  const ProcessResult result = process.wait();
  if (result.code == 0) {
    killed.stage = "complete";
    return killed;
  }
  if (!std::filesystem::exists(run.journal())) {
    killed.stage = "before";
  } else {
    try {
      const Journal journal = read_journal(run.journal());
      const auto& board = journal.of(JournalStream::board);
      killed.stage = board.empty() ? "connecting" : "running";
      if (!board.empty()) killed.recorded_s = board.back().time_s - board.front().time_s;
      if (newest_time(journal) > 0) killed.lost_s = killed_at - newest_time(journal);
      for (const auto& record : journal.of(JournalStream::event)) {
        if (record.text() == kRunComplete) killed.stage = "converting";
      }
      const double wall = killed_at / kSpeedup;
      killed.stall_s = kSpeedup * stalls.longest(wall - killed.lost_s / kSpeedup, wall);
      if (killed.stage == "running" && killed.lost_s - killed.stall_s > 0.5)
        killed.broken = "lost more than half a second";
      recover(run, journal, killed);
    } catch (const JournalError&) {
      killed.stage = "connecting";  // not even its header was there yet
    }
  }
  start_again(run, killed);
  return killed;
}

int kill_study(int count, std::ostream& csv) {
  csv << "seed,moment_s,stage,recorded_s,lost_s,stall_s,recordings,frames,broken\n";
  int broken = 0, running = 0;
  double worst = 0;
  for (int seed = 1; seed <= count; ++seed) {
    const Killed k = kill_once(static_cast<std::uint64_t>(seed));
    csv << seed << ',' << k.moment_s << ',' << k.stage << ',' << k.recorded_s << ',' << k.lost_s << ','
        << k.stall_s << ',' << k.recordings << ',' << k.frames << ",\"" << without_line_ends(k.broken) << '"'
        << std::endl;
    broken += k.broken.empty() ? 0 : 1;
    running += k.stage == "running" ? 1 : 0;
    if (k.stage == "running") worst = std::max(worst, k.lost_s - k.stall_s);
    if (isatty(STDERR_FILENO) == 1) std::cerr << "\rkilled " << seed << '/' << count << std::flush;
  }
  std::cout << count << " kills, " << running << " while recording, lost at most " << worst
            << " s (stalls of the machine deducted), " << broken << " broken promises\n";
  return broken;
}

}  // namespace
}  // namespace supertac

int main(int argc, char** argv) {
  const int count = argc > 1 ? std::atoi(argv[1]) : 0;
  std::ofstream csv(argc > 2 ? argv[2] : "/dev/null");
  if (count > 0) return supertac::kill_study(count, csv) == 0 ? 0 : 1;
  std::cerr << "usage: collect_runs COUNT [OUT.csv]\n";
  return 2;
}
