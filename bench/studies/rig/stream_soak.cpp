// stream_soak MODEL [SECONDS] [SEED]: supertac-stream on a virtual board with seeded faults, for long. Prints
// a table of what was promised and what was found; exit code 1 when a promise is broken. No ordinary test: it
// takes minutes.
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>

#include "data/frames/frame_decoder.h"
#include "hardware/collection/journal.h"
#include "hardware/ports/serial_port.h"
#include "io/files/file.h"
#include "io/files/json.h"
#include "io/numbers/numbers.h"
#include "tests/apps/common/process.h"
#include "tests/hardware/virtual_rig/rig_world.h"

namespace supertac {
namespace {

namespace fs = std::filesystem;

constexpr double kWarmS = 30;                    // until memory is compared
constexpr std::uint64_t kWord = rig::kAdcCodes;  // of a sample

/// Taxels 8 to 15, which a torn frame has fresh, carry the frame's number, four times.
void write_number(std::uint64_t number, std::array<double, 16>& volts) {
  for (std::size_t k = 8; k < volts.size(); k += 2) {
    volts[k] = rig::volts_of(static_cast<int>(number % kWord));
    volts[k + 1] = rig::volts_of(static_cast<int>(number / kWord % kWord));
  }
}

/// Nothing when a fault left no two copies alike.
std::optional<std::uint64_t> read_number(const BoardFrame& frame) {
  std::map<std::uint64_t, int> copies;
  for (int k = 8; k < rig::kTaxels; k += 2) {
    const std::uint64_t number = frame.taxel(k) + kWord * frame.taxel(k + 1);
    if (++copies[number] == 2) return number;
  }
  return std::nullopt;
}

RigSettings faulty_rig(std::uint64_t seed) {
  RigSettings settings;
  settings.printer_running = true;
  settings.seed = seed;
  settings.faults = {.byte_rate = 1e-4, .stall_rate = 2e-4, .lost_frame_rate = 5e-3};
  settings.board.signals = [begin = -1.0](double, double, double, double t) mutable {
    if (begin < 0) begin = t;
    std::array<double, 16> volts{};
    for (std::size_t k = 0; k < volts.size(); ++k)
      volts[k] = 2.3 + 0.1 * std::sin(20 * t + static_cast<double>(k));
    write_number(static_cast<std::uint64_t>(std::llround((t - begin) / rig::kFramePeriodS)), volts);
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

struct Truth {
  std::uint64_t frames = 0;  ///< received
  std::uint64_t lost =
      0;  ///< between the first and the last one read as it came: vanished, stalled or damaged
  /// Before that: between frames that had waited in the port and were read at once. They leave no gap in time
  /// and cannot be counted.
  std::uint64_t lost_waiting = 0;
};

Truth truth_in(const std::string& capture) {
  Truth truth;
  FrameDecoder decoder;
  std::optional<std::uint64_t> before;
  std::uint64_t since = 0;  // frames since `before`, this one included
  bool live = false;
  double last_s = 0;
  const Journal journal = read_journal(capture);
  for (const JournalRecord& record : journal.of(Stream::board)) {
    decoder.push(record.bytes, [&](const BoardFrame& frame, std::uint64_t) {
      ++since;
      const auto number = read_number(frame);
      if (before && number) (live ? truth.lost : truth.lost_waiting) += *number - *before - since;
      live = live || (truth.frames > 0 && record.time_s - last_s > 0.5 * rig::kFramePeriodS);
      last_s = record.time_s;
      ++truth.frames;
      if (!number) return;
      before = number;
      since = 0;
    });
  }
  return truth;
}

/// By how many frames `counted` is wrong, whatever the counter made of those that waited.
double wrong_by(const Truth& truth, double counted) {
  const auto lost = static_cast<double>(truth.lost);
  return std::abs(counted - std::clamp(counted, lost, lost + static_cast<double>(truth.lost_waiting)));
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

bool soak(const std::string& model, double seconds, std::uint64_t seed) {
  const TemporaryFolder folder;
  FaultyPtyRig rig(faulty_rig(seed), folder / "board", folder / "printer");
  RunningProcess stream("supertac-stream", {"--board", folder / "board", "--model", model, "--json",
                                            folder / "json", "--capture", folder / "capture", "--quiet"});
  wait_until_open(stream.id(), folder / "board");
  usleep(static_cast<useconds_t>(1e6 * std::min(kWarmS, seconds / 2)));
  const double warm_kb = resident_kb(stream.id());
  const std::size_t warm_open = descriptors(stream.id()).size();
  usleep(static_cast<useconds_t>(1e6 * (seconds - std::min(kWarmS, seconds / 2))));
  const double end_kb = resident_kb(stream.id());
  const std::size_t end_open = descriptors(stream.id()).size();
  stream.send(SIGTERM);
  const ProcessResult ended = stream.wait();
  if (ended.code != 128 + SIGTERM) throw std::runtime_error("supertac-stream: " + ended.error);

  const auto json = parse_json_limited(read_text_file(folder / "json", 1 << 20));
  const auto number = [&](const char* name) { return json.at(name).get<double>(); };
  const auto latency = [&](const char* name) { return json.at("latency_ms").at(name).get<double>(); };
  const Truth truth = truth_in(folder / "capture");
  Table table;
  table.row("seconds", number("seconds"));
  table.row("frames received", static_cast<double>(truth.frames));
  table.row("frames lost", static_cast<double>(truth.lost));
  table.row("frames lost while they waited", static_cast<double>(truth.lost_waiting));
  table.row("losses counted", number("lost"));
  table.at_most("losses counted wrong", wrong_by(truth, number("lost")), 0);
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
