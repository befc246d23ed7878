// Studies of how a collection ends, with the real supertac-collect on a virtual rig; minutes each.
//   collect_runs kill COUNT [OUT.csv]   kill -9 at COUNT random moments
//   collect_runs ends COUNT [OUT.csv]   COUNT random moments in contact for each of SIGINT, SIGTERM, SIGHUP
//                                       (each twice) and a full disk
//   collect_runs io STEP [OUT.csv]      the N-th call on a file fails: the first and last 30, and every
//                                       STEP-th between
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <sstream>
#include <string>

#include "bench/studies/rig/stall_watch.h"
#include "hardware/collection/collection.h"
#include "hardware/ports/errors.h"
#include "hardware/ports/serial_port.h"
#include "io/files/file.h"
#include "io/numbers/random.h"
#include "tests/apps/rig/collect_run.h"

namespace supertac {
namespace {

const std::string kRecording = "3_Bumps_t1_p1_v10.safetensors", kJournal = "3_Bumps_t1_v10.journal";

void show(const std::string& what, int done, int total) {
  if (isatty(STDERR_FILENO) == 1) std::cerr << '\r' << what << ' ' << done << '/' << total << std::flush;
}

/// Every file is a journal, a recording or the mark.
std::string left_behind(const CollectRun& run) {
  const bool marked = run.origin_unknown();
  int files = 0, known = marked ? 1 : 0;
  std::string names;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(run.disk())) {
    if (!entry.is_regular_file()) continue;
    const std::string name = entry.path().filename().string();
    ++files;
    known += name == kRecording || name == kJournal ? 1 : 0;
    names += " " + name;
  }
  return files == known ? "" : "left behind, among:" + names;
}

std::string without_line_ends(std::string text) {
  std::erase(text, '\n');
  return text;
}

// --- kill ----------------------------------------------------------------------------------------
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
      const auto& board = journal.of(Stream::board);
      killed.stage = board.empty() ? "connecting" : "running";
      if (!board.empty()) killed.recorded_s = board.back().time_s - board.front().time_s;
      if (newest_time(journal) > 0) killed.lost_s = killed_at - newest_time(journal);
      for (const auto& record : journal.of(Stream::event)) {
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
    show("killed", seed, count);
  }
  std::cout << count << " kills, " << running << " while recording, lost at most " << worst
            << " s (stalls of the machine deducted), " << broken << " broken promises\n";
  return broken;
}

// --- ends in contact -----------------------------------------------------------------------------
struct End {
  const char* name;
  int signal;
};

std::string end_once(const End& end, std::uint64_t seed, double& moment, double& z) {
  // At ten times, a machine that stood still for 0.23 s was a printer that answered none of nine M114 R.
  CollectRun run(4);
  const RandomStream random(seed, 6);
  moment = 11 * random.uniform(0);
  // A slide writes about 0.2 MB a second of the rig; the approach before it some 2 MB.
  const auto limit = static_cast<long>(2.2e6 + 2e6 * random.uniform(1));
  RunningProcess process("supertac-collect", run.arguments(),
                         {.max_file_bytes = end.signal == 0 ? limit : -1});
  if (end.signal != 0) {
    if (!run.wait_for_contact(moment, process)) {
      process.send(SIGKILL);
      return "no contact: " + process.wait().error;
    }
    process.send(end.signal);
    process.send(end.signal);
  }
  const ProcessResult result = process.wait();
  z = run.head().z;
  const int expected = end.signal == 0 ? 1 : 128 + end.signal;
  if (result.code != expected) return "exit code " + std::to_string(result.code) + ": " + result.error;
  if (!is_one_line(result.error)) return "not one line: " + result.error;
  if (z < kLiftedZ - 0.01) return "the finger was not lifted";
  return left_behind(run);
}

int end_study(int count, std::ostream& csv) {
  csv << "end,seed,moment_s,z_mm,broken\n";
  int broken = 0;
  for (const End& end :
       {End{"SIGINT", SIGINT}, End{"SIGTERM", SIGTERM}, End{"SIGHUP", SIGHUP}, End{"full disk", 0}}) {
    for (int seed = 1; seed <= count; ++seed) {
      double moment = 0, z = 0;
      const std::string wrong = end_once(end, static_cast<std::uint64_t>(seed), moment, z);
      csv << end.name << ',' << seed << ',' << moment << ',' << z << ",\"" << without_line_ends(wrong) << '"'
          << std::endl;
      broken += wrong.empty() ? 0 : 1;
      show(end.name, seed, count);
    }
  }
  std::cout << 4 * count << " ends in contact, " << broken << " broken promises\n";
  return broken;
}

// --- every I/O fault -----------------------------------------------------------------------------
struct IoFault {
  int error;
  bool forever, is_short;
};

struct IoCounts {
  int calls = 0;  ///< of the program on files of the collection
  int grave = 0;  ///< that failed and on which something depends
};

/// `wrong` is empty when it ended as promised: one line and exit code 1 when a call failed on which something
/// depends, otherwise complete.
IoCounts io_once(int at, const IoFault& fault, std::string& wrong) {
  CollectRun run(10);
  const TemporaryFolder folder;
  const std::string text = std::to_string(at) + (fault.forever ? " forever " : " once ") +
                           (fault.is_short ? "short " : "error ") + std::to_string(fault.error) + " " +
                           run.disk();
  setenv("SUPERTAC_FAULT", text.c_str(), 1);
  setenv("SUPERTAC_FAULT_COUNT", folder.file("count").c_str(), 1);
  setenv("LD_PRELOAD", SUPERTAC_IO_FAULTS, 1);
  RunningProcess process("supertac-collect", run.arguments());
  unsetenv("LD_PRELOAD");
  const ProcessResult result = process.wait();
  IoCounts counts;
  std::istringstream(read_text_file(folder.file("count"), 64)) >> counts.calls >> counts.grave;
  wrong = left_behind(run);
  if (result.code != (counts.grave == 0 ? 0 : 1))
    wrong = "exit code " + std::to_string(result.code) + ": " + result.error;
  if (counts.grave > 0 && !is_one_line(result.error)) wrong = "not one line: " + result.error;
  if (run.head().z < kLiftedZ - 0.01) wrong = "the finger was not lifted";
  return counts;
}

int io_study(int step, std::ostream& csv) {
  csv << "call,calls,grave,errno,often,kind,broken\n";
  std::string wrong;
  const int total = io_once(0, {0, false, false}, wrong).calls;
  int runs = 0, broken = 0;
  for (const IoFault& fault :
       {IoFault{ENOSPC, false, false}, IoFault{ENOSPC, true, false}, IoFault{EIO, false, false},
        IoFault{EIO, true, false}, IoFault{0, true, true}}) {
    for (int at = 1; at <= total + 5; ++at) {
      if (at > 30 && at < total - 30 && at % step != 0) continue;
      const IoCounts counts = io_once(at, fault, wrong);
      csv << at << ',' << counts.calls << ',' << counts.grave << ',' << fault.error << ','
          << (fault.forever ? "forever," : "once,") << (fault.is_short ? "short,\"" : "error,\"")
          << without_line_ends(wrong) << '"' << std::endl;
      ++runs;
      broken += wrong.empty() ? 0 : 1;
      show("call", at, total);
    }
  }
  std::cout << runs << " collections of about " << total << " calls, " << broken << " broken promises\n";
  return broken;
}

}  // namespace
}  // namespace supertac

int main(int argc, char** argv) {
  using namespace supertac;
  const std::string study = argc > 1 ? argv[1] : "";
  const int count = argc > 2 ? std::atoi(argv[2]) : 0;
  std::ofstream csv(argc > 3 ? argv[3] : "/dev/null");
  if (count > 0 && study == "kill") return kill_study(count, csv) == 0 ? 0 : 1;
  if (count > 0 && study == "ends") return end_study(count, csv) == 0 ? 0 : 1;
  if (count > 0 && study == "io") return io_study(count, csv) == 0 ? 0 : 1;
  std::cerr << "usage: collect_runs kill|ends|io COUNT [OUT.csv]\n";
  return 2;
}
