// The programs themselves: what they do, and what a wrong input gets - message, exit code, nothing left
// behind.
#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>

#include "data/recordings/recording.h"
#include "io/files/file.h"
#include "tests/apps/common/process.h"
#include "tests/io/temporary_folder.h"

namespace supertac {
namespace {

constexpr std::uint64_t kPlenty = 1 << 26;

/// A short text pass over nothing: frames of rest.
std::string rest_lines(int count) {
  std::string text;
  for (int i = 0; i < count; ++i) {
    for (int k = 0; k < kTaxels; ++k) text += "2.4" + std::to_string((i + k) % 3) + " ";
    text += "\n";
  }
  return text;
}

/// A tree of text recordings with one pass, as the rig leaves it.
std::string text_tree(const TemporaryFolder& folder, const std::string& text,
                      const std::string& name = "3_Bumps/1/1.txt") {
  const std::string path = folder.file("text/" + name);
  make_directories(std::filesystem::path(path).parent_path().string());
  write_file(path, text);
  return folder.file("text");
}

std::vector<std::string> small_simulation(const std::string& out) {
  return {"--out", out, "--plates", "ridges6", "--speeds", "10", "--trials", "1", "--passes", "2"};
}

/// One line on stderr that begins with the program's name, the exit code, nothing on stdout. What had worked
/// for seconds may have said before how long it would take.
void expect_failure(const ProcessResult& result, int code, const std::string& text) {
  const std::string error = std::regex_replace(result.error, std::regex("^[a-z]+: about .* to go\n"), "");
  EXPECT_EQ(result.code, code) << result.error;
  EXPECT_EQ(std::count(error.begin(), error.end(), '\n'), 1) << result.error;
  EXPECT_TRUE(error.starts_with("supertac")) << result.error;
  EXPECT_NE(result.error.find(text), std::string::npos) << result.error << "\nexpected: " << text;
}

TEST(Simulate, WritesRecordingsThatInfoDescribes) {
  TemporaryFolder folder;
  const auto simulated = run_process("supertac-simulate", small_simulation(folder.file("sim")));
  EXPECT_EQ(simulated.code, 0) << simulated.error;
  EXPECT_EQ(simulated.error, "");
  const auto paths = list_recordings(folder.file("sim"));
  ASSERT_EQ(paths.size(), 2u);
  const auto info = run_process("supertac-info", {paths[0], "--json", "-"});
  EXPECT_EQ(info.code, 0) << info.error;
  const auto card = nlohmann::json::parse(info.out);
  EXPECT_EQ(card["kind"], "recording");
  EXPECT_EQ(card["checksum"], "ok");
  EXPECT_EQ(card["metadata"]["plate"], "ridges6");
  EXPECT_EQ(card["frames"], read_recording(paths[0]).frames());
  EXPECT_NE(run_process("supertac-info", {paths[0]}).out.find("recording"), std::string::npos);
}

TEST(Export, SaysWhatItCannotExport) {
  const TemporaryFolder folder;
  ASSERT_EQ(run_process("supertac-simulate", small_simulation(folder.file("sim"))).code, 0);
  const std::string recording = list_recordings(folder.file("sim")).at(0);
  expect_failure(run_process("supertac-export", {recording, "--onnx", folder.file("m.onnx")}), 1,
                 "give a file that supertac-train wrote");
  EXPECT_FALSE(std::filesystem::exists(folder.file("m.onnx")));
  expect_failure(run_process("supertac-export", {recording}), 2,
                 "expected --onnx FILE, --c99 DIR or --mcap FILE, found none");
}

TEST(Simulate, SameSeedSameBytesForAnyThreads) {
  TemporaryFolder folder;
  for (const char* threads : {"1", "3"}) {
    auto arguments = small_simulation(folder.file(threads));
    arguments.insert(arguments.end(), {"--threads", threads, "--seed", "5"});
    EXPECT_EQ(run_process("supertac-simulate", arguments).code, 0);
  }
  const auto first = list_recordings(folder.file("1"));
  const auto second = list_recordings(folder.file("3"));
  for (std::size_t i = 0; i < 2; ++i)
    EXPECT_EQ(read_file(first[i], kPlenty), read_file(second.at(i), kPlenty));
}

TEST(Simulate, KeepsExistingFilesWithoutForce) {
  TemporaryFolder folder;
  make_directories(folder.file("sim"));
  const std::string existing = folder.file("sim/ridges6_t1_p2_v10.safetensors");
  write_file(existing, "mine");
  expect_failure(run_process("supertac-simulate", small_simulation(folder.file("sim"))), 1, "exists already");
  EXPECT_EQ(read_text_file(existing, kPlenty), "mine");
  EXPECT_FALSE(std::filesystem::exists(folder.file("sim/ridges6_t1_p1_v10.safetensors")));
  auto forced = small_simulation(folder.file("sim"));
  forced.push_back("--force");
  EXPECT_EQ(run_process("supertac-simulate", forced).code, 0);
  EXPECT_NO_THROW(read_recording(existing));
}

TEST(Simulate, AWrongCommandLineIsCode2) {
  TemporaryFolder folder;
  const std::string out = folder.file("sim");
  const std::pair<std::vector<std::string>, std::string> cases[] = {
      {{}, "missing --out DIR"},
      {{"--out", out, "--sede", "3"}, "did you mean '--seed'?"},
      {{"--out", out, "--seed", "-1"}, "--seed: expected a whole number"},
      {{"--out", out, "--passes", "9"}, "--passes: expected a whole number from 1 to 8, found '9'"},
      {{"--out", out, "--speeds", "0"}, "--speeds: expected numbers from 0.5 to 50, found '0'"},
      {{"--out", out, "--speeds", "1,5e"}, "found '5e'"},
      {{"--out", out, "--plates", "moon"}, "moon"},
      {{"--out", out, "--without", "gravity"}, "gravity"},
      {{"--out", out, "--threads", "0"}, "--threads: expected a whole number from 1 to 1024"},
      {{"--out", out, "more"}, "unexpected argument 'more'"}};
  for (const auto& [arguments, text] : cases) {
    expect_failure(run_process("supertac-simulate", arguments), 2, text);
    EXPECT_EQ(folder.entries(), 0u) << text;
  }
}

TEST(Simulate, ASignalRemovesWhatWasMadeAndTellsSo) {
  for (const int signal : {SIGINT, SIGTERM}) {
    TemporaryFolder folder;
    const auto result = run_process("supertac-simulate", {"--out", folder.file("sim"), "--trials", "200"},
                                    {.signal = signal, .signal_when = folder.file("*")});
    expect_failure(result, 128 + signal, "stopped by signal");
    EXPECT_EQ(folder.entries(), 0u);
  }
}

TEST(Output, PlacesThatCannotBeWritten) {
  TemporaryFolder folder;
  write_file(folder.file("file"), "x");
  expect_failure(run_process("supertac-simulate", small_simulation(folder.file("file"))), 1,
                 folder.file("file"));
  expect_failure(run_process("supertac-simulate", small_simulation(folder.file("file/sim"))), 1,
                 "Not a directory");
  expect_failure(run_process("supertac-simulate", small_simulation("/proc/supertac")), 1, "/proc/supertac");
  if (geteuid() != 0) {  // root may write anywhere
    make_directories(folder.file("locked"));
    std::filesystem::permissions(folder.file("locked"), std::filesystem::perms::owner_read);
    expect_failure(run_process("supertac-simulate", small_simulation(folder.file("locked/sim"))), 1,
                   "permissions");
    std::filesystem::permissions(folder.file("locked"), std::filesystem::perms::owner_all);
  }
  EXPECT_EQ(read_text_file(folder.file("file"), kPlenty), "x");
}

TEST(Output, ADiskThatFillsUpLeavesNothing) {
  TemporaryFolder folder;
  // The first recording has some 130 kB.
  expect_failure(
      run_process("supertac-simulate", small_simulation(folder.file("sim")), {.max_file_bytes = 50'000}), 1,
      "cannot write: File too large");
  EXPECT_EQ(folder.entries(), 0u);
}

TEST(Output, JsonIsWrittenAtomicallyAndNotOverAnother) {
  TemporaryFolder folder;
  auto arguments = small_simulation(folder.file("sim"));
  arguments.insert(arguments.end(), {"--json", folder.file("report.json")});
  EXPECT_EQ(run_process("supertac-simulate", arguments).code, 0);
  const std::string report = read_text_file(folder.file("report.json"), kPlenty);
  EXPECT_EQ(nlohmann::json::parse(report)["recordings"], 2);
  arguments[1] = folder.file("again");
  expect_failure(run_process("supertac-simulate", arguments), 1, "report.json: exists already");
  EXPECT_FALSE(std::filesystem::exists(folder.file("again")));
  EXPECT_EQ(read_text_file(folder.file("report.json"), kPlenty), report);
}

TEST(Import, ReportsEveryFile) {
  TemporaryFolder folder;
  const std::string text = text_tree(folder, rest_lines(900) + "1 2 3\n" + rest_lines(900));
  const auto result = run_process(
      "supertac-import",
      {text, "--out", folder.file("out"), "--json", folder.file("j"), "--pictures", folder.file("pictures")});
  EXPECT_EQ(result.code, 0) << result.error;
  EXPECT_NE(result.out.find("3_Bumps/1/1.txt  1801 lines, 1 dropped (1 malformed)"), std::string::npos)
      << result.out;
  EXPECT_NE(result.out.find("not reliable"), std::string::npos) << result.out;  // it touches nothing
  const auto report = nlohmann::json::parse(read_text_file(folder.file("j"), kPlenty));
  EXPECT_EQ(report["files"][0]["too_few_columns"], 1);
  const auto recording = read_recording(folder.file("out/3_Bumps_t1_p1_v10.safetensors"));
  EXPECT_EQ(recording.frames(), 1800u);
  EXPECT_EQ(recording.metadata.at("registration_reliable"), "no");
  const std::string page = read_text_file(folder.file("pictures/index.html"), kPlenty);
  for (const char* part :
       {"3_Bumps, trial 1, pass 1", "not reliable", "data:image/png;base64,", "y on the plate, mm"})
    EXPECT_NE(page.find(part), std::string::npos) << part;
  for (const char* outside : {"http://", "https://", "<!--", "{{"})
    EXPECT_EQ(page.find(outside), std::string::npos) << outside;
}

TEST(Import, ACutPassIsFlaggedNotRefused) {
  TemporaryFolder folder;
  const std::string text = text_tree(folder, rest_lines(3));
  const auto result = run_process("supertac-import", {text, "--out", folder.file("out")});
  EXPECT_EQ(result.code, 0) << result.error;
  EXPECT_NE(result.out.find("not reliable"), std::string::npos) << result.out;
}

TEST(Import, BadInputIsOneLineAndLeavesNothing) {
  const std::string good = rest_lines(100);
  const std::string columns_15 = "1 1 1 1 1 1 1 1 1 1 1 1 1 1 1\n";
  const std::tuple<std::string, std::string, std::string> cases[] = {
      {"3_Bumps/1/1.txt", "", "is empty"},
      {"3_Bumps/1/1.txt", "no numbers at all\n", "1 of 1 lines are not 16 voltages"},
      {"3_Bumps/1/1.txt", columns_15, "1 with fewer columns"},
      {"3_Bumps/1/1.txt", rest_lines(1) + columns_15, "1 with fewer columns"},
      {"3_Bumps/1/1.txt", std::string(3000, '\xff'), "is it a recording?"},
      {"7_Moons/1/1.txt", good, "unknown plate: "},
      {"3_Bumps/one/1.txt", good, "expected a number from 1"},
      {"3_Bumps/1/first.txt", good, "expected a number from 1"},
      {"3_Bumps/1/1.csv", good, "holds no <plate>/<trial>/<pass>.txt"}};
  for (const auto& [name, text, message] : cases) {
    TemporaryFolder folder;
    const std::string tree = text_tree(folder, text, name);
    expect_failure(run_process("supertac-import", {tree, "--out", folder.file("out")}), 1, message);
    EXPECT_FALSE(std::filesystem::exists(folder.file("out"))) << message;
  }
  TemporaryFolder folder;
  expect_failure(run_process("supertac-import", {folder.file("none"), "--out", folder.file("out")}), 1,
                 "cannot list");
  expect_failure(run_process("supertac-import", {folder.path()}), 2, "missing --out DIR");
}

TEST(Import, SkipBadLeavesOutWhatIsNoRecording) {
  TemporaryFolder folder;
  text_tree(folder, "garbage\n");
  const std::string text = text_tree(folder, rest_lines(100), "3_Bumps/1/2.txt");
  const auto strict = run_process("supertac-import", {text, "--out", folder.file("out")});
  expect_failure(strict, 1, "--skip-bad leaves such files out");
  EXPECT_FALSE(std::filesystem::exists(folder.file("out")));
  const auto lenient = run_process("supertac-import", {text, "--out", folder.file("out"), "--skip-bad"});
  EXPECT_EQ(lenient.code, 0);
  EXPECT_NE(lenient.error.find("left out: "), std::string::npos);
  EXPECT_EQ(list_recordings(folder.file("out")).size(), 1u);
}

TEST(Info, RefusesWhatItCannotRead) {
  TemporaryFolder folder;
  write_file(folder.file("empty"), "");
  write_file(folder.file("absurd"), std::string(64, '\xff'));
  expect_failure(run_process("supertac-info", {folder.file("none")}), 1, "No such file or directory");
  expect_failure(run_process("supertac-info", {folder.path()}), 1, "has no recordings");
  expect_failure(run_process("supertac-info", {folder.file("empty")}), 1, "has 0 bytes, expected at least 8");
  expect_failure(run_process("supertac-info", {folder.file("absurd")}), 1,
                 "header length 18446744073709551615");
  expect_failure(run_process("supertac-info", {}), 2, "missing FILE");
}

TEST(Info, SendsNoControlCodesToTheTerminal) {
  TemporaryFolder folder;
  std::string header = R"({"__metadata__":{"a\u001b[31m":"b\n\u001b]0;x"}})";
  header.resize(64, ' ');
  write_file(folder.file("a"), std::string("\x40\0\0\0\0\0\0\0", 8) + header);
  const auto result = run_process("supertac-info", {folder.file("a")});
  EXPECT_EQ(result.code, 0) << result.error;
  EXPECT_EQ(result.out.find('\x1b'), std::string::npos);
  EXPECT_NE(result.out.find("absent"), std::string::npos);
}

TEST(Dispatcher, RunsTheProgramsNextToIt) {
  EXPECT_EQ(run_process("supertac", {}).code, 2);
  expect_failure(run_process("supertac", {"simulat"}), 2,
                 "unknown job 'simulat'; did you mean 'simulate'? (supertac --help lists them)");
  EXPECT_NE(run_process("supertac", {"info", "--version"}).out.find("supertac-info "), std::string::npos);
  expect_failure(run_process("supertac", {"info"}), 2, "missing FILE");
}

TEST(Dispatcher, HelpIsThatOfTheJobOrTheGlossary) {
  EXPECT_EQ(run_process("supertac", {"help", "info"}).out, run_process("supertac-info", {"--help"}).out);
  EXPECT_EQ(run_process("supertac", {"help"}).out, run_process("supertac", {"--help"}).out);
  expect_failure(run_process("supertac", {"help", "inf"}), 2, "did you mean 'info'?");
  const std::string glossary = run_process("supertac", {"help", "glossary"}).out;
  for (const char* term : {"taxel", "window", "pass", "trial", "split", "normalised per window", "latent",
                           "contact", "SSIM", "ghost rate"})
    EXPECT_NE(glossary.find("**" + std::string(term) + "** - "), std::string::npos) << term;
  EXPECT_NE(run_process("supertac", {"--help"}).out.find("supertac help glossary"), std::string::npos);
}

TEST(Help, OffersNoThreadsWhereThereIsNothingToShareOut) {
  EXPECT_EQ(run_process("supertac-info", {"--help"}).out.find("--threads"), std::string::npos);
  EXPECT_NE(run_process("supertac-simulate", {"--help"}).out.find("--threads"), std::string::npos);
}

TEST(Help, BreaksNoWords) {
  // Words of the help as declared; a line that ends within one would leave a part of it.
  const std::string help = run_process("supertac-train", {"--help"}).out;
  for (const char* word :
       {"multiply-adds", "safetensors", "recordings", "overwritten", "interrupted", "learning"}) {
    const std::string text(word);
    for (std::size_t cut = 4; cut + 3 < text.size(); ++cut)
      EXPECT_EQ(help.find(text.substr(0, cut) + "\n"), std::string::npos) << text;
  }
}

TEST(Collect, SaysWhichOptionIsMissing) {
  const TemporaryFolder folder;
  expect_failure(run_process("supertac-collect", {"--plate", "6_Ridges", "--out", folder.file("c")}), 2,
                 "missing --printer, which a collection needs beside");
  const std::string help = run_process("supertac-collect", {"--help"}).out;
  EXPECT_NE(help.find("port of the Marlin printer; needed"), std::string::npos) << help;
}

TEST(Simulate, SaysThatAFolderHasRecordingsAlready) {
  const TemporaryFolder folder;
  EXPECT_EQ(run_process("supertac-simulate", small_simulation(folder.file("sim"))).error, "");
  auto more = small_simulation(folder.file("sim"));
  more[3] = "bumps6";
  EXPECT_NE(run_process("supertac-simulate", more).error.find("held 2 recordings before"), std::string::npos);
}

TEST(Dispatcher, EveryProgramOfTheListIsThereAndSaysWhatItIsFor) {
  std::istringstream lines(run_process("supertac", {"--help"}).out);
  std::size_t programs = 0;
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with("  ") || line.starts_with("  supertac")) continue;
    const std::string job = line.substr(2, line.find(' ', 2) - 2), program = "supertac-" + job;
    const std::string purpose = line.substr(14);
    const auto help = run_process(program, {"--help"});
    EXPECT_EQ(help.code, 0) << program << help.error;
    EXPECT_TRUE(help.out.starts_with(purpose)) << program << ": " << help.out;
    EXPECT_NE(help.out.find("Usage:\n  " + program), std::string::npos) << help.out;
    const auto version = run_process(program, {"--version"});
    EXPECT_TRUE(version.out.starts_with(program + " ")) << version.out;
    for (const char* text : {"commit ", "compiler  "}) EXPECT_NE(version.out.find(text), std::string::npos);
    ++programs;
  }
  EXPECT_GE(programs, 10u);
}

}  // namespace
}  // namespace supertac
