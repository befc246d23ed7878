// stream_soak MODEL [SECONDS] [SEED]: supertac-stream on a virtual board with seeded faults, for long. Prints
// a table of what was promised and what was found; exit code 1 when a promise is broken. No ordinary test: it
// takes minutes.
#include <unistd.h>

#include <cmath>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "hardware/serial_port.h"
#include "hardware/virtual_rig/pty_rig.h"
#include "io/file.h"
#include "io/json.h"
#include "io/numbers.h"
#include "tests/apps/process.h"

namespace supertac {
namespace {

namespace fs = std::filesystem;

constexpr double kWarmS = 30;  // until memory is compared
// Lost before the first or after the last frame received, a loss leaves no gap to be counted; a stall
// takes 20.
constexpr double kUnseenLosses = 24;

RigSettings faulty_rig(uint64_t seed) {
  RigSettings settings;
  settings.printer_running = true;
  settings.seed = seed;
  settings.faults = {.byte_rate = 1e-4, .stall_rate = 2e-4, .lost_frame_rate = 5e-3};
  settings.board.signals = [](double, double, double, double t) {
    std::array<double, 16> volts{};
    for (size_t k = 0; k < volts.size(); ++k)
      volts[k] = 2.3 + 0.1 * std::sin(20 * t + static_cast<double>(k));
    return volts;
  };
  return settings;
}

std::string proc(pid_t id, const std::string& what) { return "/proc/" + std::to_string(id) + "/" + what; }

double resident_kb(pid_t id) {
  std::ifstream file(proc(id, "statm"));
  double size = 0, resident = 0;
  file >> size >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1024;
}

std::vector<std::string> descriptors(pid_t id) {
  std::vector<std::string> open;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(proc(id, "fd"), error))
    open.push_back(fs::read_symlink(entry.path(), error).string());
  return open;
}

void wait_until_open(pid_t id, const std::string& port) {
  const std::string device = fs::canonical(port).string();
  for (int i = 0; i < 20'000; ++i, usleep(500)) {
    for (const std::string& open : descriptors(id))
      if (open == device) return;
  }
  throw std::runtime_error("supertac-stream did not open the port within 10 s");
}

VirtualBoard::Counters counters_of(PtyRig& rig) {
  VirtualBoard::Counters counters;
  rig.with_world([&](RigWorld& world) { counters = world.board().counters(); });
  return counters;
}

class Table {
 public:
  Table() { std::puts("quantity,measured,promised"); }
  void row(const char* quantity, double measured) { print(quantity, measured, ""); }
  void at_most(const char* quantity, double measured, double limit) {
    kept_ = kept_ && measured <= limit;
    print(quantity, measured, "<= " + format(limit));
  }
  bool kept() const { return kept_; }

 private:
  static void print(const char* quantity, double measured, const std::string& promised) {
    std::printf("%s,%s,%s\n", quantity, format(std::round(1000 * measured) / 1000).c_str(), promised.c_str());
  }
  bool kept_ = true;
};

bool soak(const std::string& model, double seconds, uint64_t seed) {
  const TemporaryFolder folder;
  PtyRig rig(faulty_rig(seed), folder / "board", folder / "printer");
  RunningProcess stream("supertac-stream", {"--board", folder / "board", "--model", model, "--json",
                                            folder / "json", "--quiet"});
  wait_until_open(stream.id(), folder / "board");
  const VirtualBoard::Counters begin = counters_of(rig);
  usleep(static_cast<useconds_t>(1e6 * std::min(kWarmS, seconds / 2)));
  const double warm_kb = resident_kb(stream.id());
  const size_t warm_open = descriptors(stream.id()).size();
  usleep(static_cast<useconds_t>(1e6 * (seconds - std::min(kWarmS, seconds / 2))));
  const double end_kb = resident_kb(stream.id());
  const size_t end_open = descriptors(stream.id()).size();
  stream.send(SIGTERM);
  const VirtualBoard::Counters end = counters_of(rig);
  const ProcessResult ended = stream.wait();
  if (ended.code != 128 + SIGTERM) throw std::runtime_error("supertac-stream: " + ended.error);

  const auto json = parse_json_limited(read_text_file(folder / "json", 1 << 20));
  const auto number = [&](const char* name) { return json.at(name).get<double>(); };
  const auto latency = [&](const char* name) { return json.at("latency_ms").at(name).get<double>(); };
  // What the board made since it is listened to, and the 25 frames that waited in the port, is received or
  // lost: vanished, stalled, or damaged beyond recognition.
  const auto made = static_cast<double>(end.made - begin.lost);
  const double lost = made - number("frames");
  Table table;
  table.row("seconds", number("seconds"));
  table.row("frames made", made);
  table.row("frames received", number("frames"));
  table.row("frames lost", lost);
  table.row("losses counted", number("lost"));
  table.at_most("difference of the losses", std::abs(lost - number("lost")), kUnseenLosses);
  table.row("pictures", number("pictures"));
  table.row("pictures dropped", number("dropped"));
  table.row("latency median ms", latency("median"));
  table.at_most("latency p99 ms", latency("p99"), 10);
  table.row("latency p99.9 ms", latency("p99.9"));
  table.at_most("memory kB", end_kb, 40 * 1024);
  table.at_most("memory drift kB", end_kb - warm_kb, 1024);
  table.at_most("descriptors gained", static_cast<double>(end_open) - static_cast<double>(warm_open), 0);
  return table.kept();
}

}  // namespace
}  // namespace supertac

int main(int argc, char** argv) {
  using namespace supertac;
  const auto seconds = parse_double(argc > 2 ? argv[2] : "600");
  const auto seed = parse_uint(argc > 3 ? argv[3] : "1");
  if (argc < 2 || argc > 4 || !seconds || *seconds < 2 || !seed) {
    std::fputs("usage: stream_soak MODEL [SECONDS] [SEED]\n", stderr);
    return 2;
  }
  try {
    return soak(argv[1], *seconds, *seed) ? 0 : 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "stream_soak: %s\n", error.what());
    return 1;
  }
}
