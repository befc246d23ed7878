// hostile lines N SEED: N command lines of evil values for every option of every program.
// hostile mutants N SEED: N seeded mutants through every reader, in this process; build it with the preset
// asan. hostile signals N SEED: N simulations, imports and trainings ended by a signal at a random moment.
// hostile files N SEED: N files that are valid and lie. hostile devices N SEED: N collections, in simulated
// time, with printers that lie, that another job left otherwise, that are stopped at their display, boards
// that send in bursts, and hosts that stall. One table of counts on stdout; exit 1 when anything was found.
// Run it as an ordinary user or as root: as root the programs run as nobody, since evil values are also names
// of outputs.
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <regex>
#include <set>
#include <span>
#include <sstream>

#include "io/files/file.h"
#include "io/numbers/clock.h"
#include "io/numbers/random.h"
#include "tests/apps/common/process.h"
#include "tests/apps/hostile/hostile.h"

namespace supertac {
namespace {

namespace fs = std::filesystem;

constexpr const char* kPrograms[] = {"check", "classify", "collect",  "evaluate", "export", "import",
                                     "info",  "plate",    "simulate", "stream",   "train",  "rig"};
// A command that works, on which evil is heaped; a later option replaces an earlier one.
const std::map<std::string, std::vector<std::string>> kGood = {
    {"check", {"file", "model", "data"}},
    {"classify", {"--model", "model", "--data", "data", "--epochs", "1"}},
    {"collect",
     {"--printer", "/dev/null", "--board", "/dev/null", "--plate", "plain", "--out", "new", "--yes"}},
    {"evaluate", {"--model", "model", "--data", "data", "--split", "none", "--limit", "9"}},
    {"export", {"model", "--onnx", "new.onnx"}},
    {"import", {"data", "--out", "new"}},
    {"info", {"data/good"}},
    {"plate", {"--plate", "plain", "--out", "new.stl"}},
    {"simulate", {"--out", "new", "--plates", "plain", "--passes", "1", "--trials", "1", "--speeds", "50"}},
    {"stream", {"--model", "model", "--recording", "data/good"}},
    {"train", {"--data", "data", "--out", "new.model", "--epochs", "1", "--preset", "tiny"}},
    {"rig", {"--plate", "plain", "--board-link", "new.board", "--printer-link", "new.printer"}}};
constexpr int kSkipped = 77;
constexpr double kPatienceS = 1, kHangS = 10;
constexpr long kMostKilobytes = 1 << 20;
constexpr std::uint64_t kMost = 1 << 26;  // bytes of a file that is compared
// By --force a user gives up what these name, and nothing else.
constexpr const char* kOutputs[] = {"--out",          "--json",     "--outputs", "--capture",
                                    "--report",       "--pictures", "--onnx",    "--board-link",
                                    "--printer-link", "--mcap",     "--c99"};
// What no program may change.
constexpr const char* kKept[] = {"precious", "precious.stl", "model", "data/good"};

struct Option {
  std::string name, value;
};

struct Run : ProcessResult {
  bool hung = false, large = false;
};

void prepare(const fs::path& folder) {
  fs::create_directories(folder / "data" / "1");
  fs::create_directories(folder / "empty");
  fs::create_symlink("loop", folder / "loop");
  fs::create_symlink("precious", folder / "link");
  (void)mkfifo((folder / "fifo").c_str(), 0666);
  std::ofstream(folder / "precious") << "precious";
  std::ofstream(folder / "precious.stl") << "precious";
}

// Ends it with `signal` after `seconds`; what then does not end within kHangS hangs.
Run run(const fs::path& folder, const std::vector<std::string>& words, double seconds, int signal = SIGTERM) {
  Run result;
  RunningProcess process(words[0], {words.begin() + 1, words.end()}, {.folder = folder, .nobody = true});
  const double begin = seconds_of(CLOCK_MONOTONIC);
  for (bool asked = false; !process.ended(); usleep(2000)) {
    const double took = seconds_of(CLOCK_MONOTONIC) - begin;
    if (!asked && took > seconds) process.send(signal), asked = true;
    if (!result.hung && took > seconds + kHangS) process.send(SIGKILL), result.hung = true;
  }
  static_cast<ProcessResult&>(result) = process.wait();
  result.large = result.kilobytes > kMostKilobytes;
  return result;
}

// A program that has to succeed.
void run_whole(const fs::path& folder, std::vector<std::string> words) {
  words[0] = SUPERTAC_BIN "/supertac-" + words[0];
  const Run whole = run(folder, words, 60);
  if (whole.code != 0) throw std::runtime_error(words[0] + ": " + whole.error);
}

std::vector<Option> options_of(const std::string& program) {
  std::vector<Option> options;
  const std::string help = run_process(fs::path(program).filename(), {"--help"}).out;
  const std::regex shape(R"((?:^|\n)\s+(?:-h, )?--([a-z0-9-]+)( [A-Z][^ ]*)?)");
  for (std::sregex_iterator match(help.begin(), help.end(), shape), end; match != end; ++match)
    options.push_back({(*match)[1], (*match)[2]});
  return options;
}

using Files = std::map<std::string, std::vector<std::byte>>;  // by name

bool is_output(const std::string& option) {
  return std::find(std::begin(kOutputs), std::end(kOutputs), option) != std::end(kOutputs);
}

// Whether these words give up the file: --force, and an output whose value is the file, a link to it or a
// folder that holds it.
bool given_up(const fs::path& folder, const std::vector<std::string>& words, const std::string& file) {
  if (std::find(words.begin(), words.end(), "--force") == words.end()) return false;
  std::error_code error;
  const std::string whole = (folder / file).string();
  for (std::size_t i = 0; i + 1 < words.size(); ++i) {
    if (!is_output(words[i])) continue;
    const std::string output = fs::weakly_canonical(folder / words[i + 1], error).string();
    if (output == whole || (output != folder && whole.starts_with(output + "/"))) return true;
  }
  return false;
}

// Writes it as nobody's, whom the programs run as, and makes the folders that it needs.
void put(const fs::path& folder, const std::string& file, std::span<const std::byte> bytes) {
  fs::create_directories((folder / file).parent_path());
  std::ofstream(folder / file, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  for (fs::path path = folder / file; path != folder; path = path.parent_path())
    if (::getuid() == 0 && ::chown(path.c_str(), 65534, 65534) != 0)
      throw std::runtime_error("chown " + path.string());
}

void judge(const Run& result, const fs::path& folder, const std::vector<std::string>& words,
           const Files& kept, Counts& counts) {
  std::string line;
  for (const std::string& word : words) line += word.substr(0, 60) + " ";
  const auto found = [&](const char* what) {
    ++counts[what];
    std::cerr << what << ": " << line << "\n  " << result.error.substr(0, 300) << '\n';
  };
  if (result.hung) return found("hangs");
  ++counts["exit " + std::to_string(result.code)];
  if (result.code == 126) throw std::runtime_error("cannot start " + line);
  const int signal = result.code - 128;
  if (result.code > 126 && signal != SIGTERM && signal != SIGINT && signal != SIGHUP) found("crashes");
  if (result.error.find("Sanitizer") != std::string::npos ||
      result.error.find("runtime error:") != std::string::npos)
    found("crashes");
  if (result.large) found("above 1 GB");
  for (const char* raw :
       {"what():", "filesystem error", "[json.", "std::", "basic_string", "terminate called"})
    if (result.error.find(raw) != std::string::npos) return found("raw exceptions");
  if (result.error.find('\x1b') != std::string::npos) found("control codes");
  if (fs::exists(folder / "PWNED")) found("shells"), fs::remove(folder / "PWNED");
  for (const auto& [file, bytes] : kept) {
    if (fs::is_regular_file(folder / file) && read_file(folder / file, kMost) == bytes) continue;
    if (!given_up(folder, words, file)) found("files overwritten");
    fs::remove_all(folder / file);
    put(folder, file, bytes);
  }
}

Counts command_lines(const fs::path& folder, const Files& kept, std::uint64_t n, std::uint64_t seed) {
  Counts counts;
  std::map<std::string, std::vector<Option>> options;
  for (const char* name : kPrograms)
    options[name] = options_of(std::string(SUPERTAC_BIN "/supertac-") + name);
  for (std::uint64_t i = 0; i < n; ++i) {
    const RandomStream random(seed, i);
    const std::string name = kPrograms[i % std::size(kPrograms)];
    std::vector<std::string> words = {std::string(SUPERTAC_BIN "/supertac-") + name};
    std::uint64_t at = 0;
    if (random.bits(at++) % 4 != 0) words.insert(words.end(), kGood.at(name).begin(), kGood.at(name).end());
    const std::size_t begin = words.size();
    for (const std::uint32_t most = 1 + random.bits(at++) % 3; words.size() < begin + 2 * most;) {
      const Option& option = options[name][random.bits(at++) % options[name].size()];
      if (option.name == "help") {
        if (random.bits(at++) % 8 != 0) break;
        continue;
      }
      words.push_back("--" + option.name);
      if (!option.value.empty()) words.push_back(evil_value(random, at++));
    }
    if (random.bits(at++) % 4 == 0) words.push_back(evil_value(random, at++));
    if (random.bits(at++) % 4 == 0) words.push_back("--force"), ++counts["with --force"];
    ++counts["command lines"];
    judge(run(folder, words, kPatienceS), folder, words, kept, counts);
    for (const auto& entry : fs::directory_iterator(folder))
      if (entry.path().filename().string().starts_with("new")) fs::remove_all(entry.path());
  }
  return counts;
}

// Text files of a collection, and a command of some tenths of a second for each kind of output.
void write_texts(const fs::path& folder) {
  for (const char* trial : {"1", "2"}) {
    fs::create_directories(folder / "texts/6_Ridges" / trial);
    for (int pass = 1; pass <= 4; ++pass) {
      std::ofstream file(folder / "texts/6_Ridges" / trial / (std::to_string(pass) + ".txt"));
      for (int i = 0; i < 4000; ++i)
        for (int k = 0; k < 16; ++k)
          file << 2.4 - 0.1 * std::abs(std::sin(0.01 * i + k)) << (k < 15 ? ' ' : '\n');
    }
  }
}

std::set<std::string> names_in(const fs::path& folder) {
  std::set<std::string> names;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    names.insert(fs::relative(entry.path(), folder).string());
  return names;
}

Counts signals(const fs::path& folder, const Files& kept, std::uint64_t n, std::uint64_t seed) {
  Counts counts;
  write_texts(folder);
  const std::vector<std::vector<std::string>> commands = {
      {"simulate", "--plates", "ridges6"},
      {"import", "texts", "--skip-bad"},
      {"train", "--data", "whole0", "--preset", "tiny", "--epochs", "1", "--split", "none", "--stride",
       "64"}};
  for (std::size_t i = 0; i < commands.size(); ++i) {  // what ends by itself at once would not be attacked
    std::vector<std::string> words = commands[i];
    words.insert(words.end(), {"--out", "whole" + std::to_string(i)});
    run_whole(folder, words);
  }
  for (std::uint64_t i = 0; i < n; ++i) {
    const RandomStream random(seed, i);
    const std::string out = "signals" + std::to_string(i);
    std::vector<std::string> words = commands[i % commands.size()];
    words[0] = SUPERTAC_BIN "/supertac-" + words[0];
    words.insert(words.end(), {"--out", out});
    const int signal = std::array{SIGTERM, SIGINT, SIGHUP}[random.bits(1) % 3];
    const Run result = run(folder, words, 0.4 * random.uniform(0), signal);
    ++counts["signals"];
    judge(result, folder, words, kept, counts);
    // A signal may come when the folder has its name already: the folder is then whole.
    const std::string whole = "whole" + std::to_string(i % commands.size());
    if (fs::is_directory(folder / out) && names_in(folder / out) != names_in(folder / whole)) {
      ++counts["half folders"];
      std::cerr << "half a folder: " << out << ' ' << words[0] << '\n';
    }
    for (const char* left : {"", ".run"}) fs::remove_all(folder / (out + left));
  }
  return counts;
}

int main_of(const std::string& mode, std::uint64_t n, std::uint64_t seed) {
  std::string name = (fs::temp_directory_path() / "hostile-XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("no scratch folder");
  const fs::path folder = name;
  prepare(folder);
  if (::getuid() == 0)
    for (const auto& path : {folder, folder / "data", folder / "data" / "1", folder / "empty",
                             folder / "precious", folder / "precious.stl"})
      if (::chown(path.c_str(), 65534, 65534) != 0) throw std::runtime_error("chown " + path.string());
  const Run start = run(folder, {SUPERTAC_BIN "/supertac-info", "--version"}, 60);
  if (start.code != 0) {
    fs::remove_all(folder);
    std::cerr << "skipped: nobody but root may run what is in " SUPERTAC_BIN "\n";
    return kSkipped;
  }
  run_whole(folder, {"simulate", "--out", "data", "--plates", "plain", "--passes", "1", "--trials", "1",
                     "--speeds", "10"});
  fs::rename(folder / "data/plain_t1_p1_v10.safetensors", folder / "data/good");
  run_whole(folder, {"simulate", "--out", "felt", "--plates", "ridges6", "--passes", "1", "--trials", "1"});
  run_whole(folder, {"train", "--data", "felt", "--out", "model", "--preset", "tiny", "--split", "none",
                     "--epochs", "1", "--stride", "64"});
  Files kept;
  for (const char* file : kKept) kept[file] = read_file(folder / file, kMost);
  Counts counts;
  if (mode == "lines") counts = command_lines(folder, kept, n, seed);
  if (mode == "signals") counts = signals(folder, kept, n, seed);
  if (mode == "mutants") counts = mutants_of_readers(folder.string(), n, seed);
  if (mode == "files") counts = lying_files(folder.string(), n, seed);
  if (mode == "devices") counts = lying_devices(n, seed);
  fs::remove_all(folder);
  const auto print = [&](std::initializer_list<const char*> names) {
    std::uint64_t sum = 0;
    for (const char* name_of_count : names) {
      std::cout << name_of_count << "," << counts[name_of_count] << '\n';
      sum += counts[name_of_count];
    }
    return sum;
  };
  print({"command lines", "with --force", "exit 0", "exit 1", "exit 2", "exit 129", "exit 130", "exit 143",
         "signals", "mutants", "lying files", "collections", "complete", "typed errors"});
  const std::uint64_t findings =
      print({"broken promises", "slow mutants", "crashes", "hangs", "above 1 GB", "raw exceptions",
             "control codes", "shells", "files overwritten", "half folders"});
  return findings == 0 ? 0 : 1;
}

}  // namespace

std::string evil_value(const RandomStream& random, std::uint64_t at) {
  static const std::vector<std::string> values = [] {
    std::vector<std::string> all = {
        "", "x\ny", "\x1b[31mred", "\xff\xfe", std::string(300, 'x'), std::string(5000, 'y')};
    std::istringstream words(
        "0 -1 1 2 nan inf 1e308 1e-308 18446744073709551616 0x10 1,,2 , plain ridges6 ridges0.0000001 "
        "ridgesinf "
        "bumps-1 precious precious.stl data data/1 data/good model new new/er loop fifo empty link /dev/null "
        "/dev/zero /dev/full /proc/self/mem / . .. - -- $(touch${IFS}PWNED) `touch${IFS}PWNED` "
        "a;touch${IFS}PWNED "
        "q';system('touch${IFS}PWNED');x=' 4x4 16x16 window paper %s%n%x precious,precious");
    for (std::string word; words >> word;) all.push_back(word);
    return all;
  }();
  return values[random.bits(at) % values.size()];
}

}  // namespace supertac

int main(int argc, char** argv) {
  if (argc != 4) {
    std::cerr << "hostile: expected lines|mutants|signals|files|devices N SEED, found " << argc - 1
              << " words\n";
    return 2;
  }
  // Who starts this behind nohup or in a script's background leaves some of them ignored.
  for (const int signal : {SIGTERM, SIGINT, SIGHUP}) std::signal(signal, SIG_DFL);
  if (std::freopen("/dev/null", "r", stdin) == nullptr) return 2;
  return supertac::main_of(argv[1], std::stoull(argv[2]), std::stoull(argv[3]));
}
