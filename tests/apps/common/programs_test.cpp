// The programs themselves: what they do, and what a wrong input gets - message, exit code, nothing left
// behind.
#include <unistd.h>

#include <csignal>
#include <nlohmann/json.hpp>
#include <sstream>

#include "data/recordings/recording.h"
#include "io/files/file.h"
#include "tests/apps/common/expect.h"
#include "tests/data/test_recordings.h"
#include "tests/support/test.h"

namespace supertac::programs_test {

std::string small_simulation(const std::string& out) {
  return "supertac-simulate --out " + out + " --plates ridges6 --speeds 10 --trials 1 --passes 2 ";
}

using Dispatcher = ProgramTest;
using Export = ProgramTest;
using Import = ProgramTest;
using Info = ProgramTest;
using Output = ProgramTest;
using Simulate = ProgramTest;

TEST_F(Simulate, WritesRecordingsThatInfoDescribes) {
  EXPECT_EQ(succeed(small_simulation("sim")).error, "");
  const auto paths = list_recordings(path("sim"));
  ASSERT_EQ(paths.size(), 2u);
  const ProcessResult info = succeed("supertac-info " + paths[0] + " --json -");
  const auto card = nlohmann::json::parse(info.out);
  EXPECT_EQ(card["kind"], "recording");
  EXPECT_EQ(card["checksum"], "ok");
  EXPECT_EQ(card["metadata"]["plate"], "ridges6");
  const Recording recording = read_recording(paths[0]);
  EXPECT_EQ(card["frames"], recording.frames());
  EXPECT_EQ(card["duration_s"], recording.time_s.back() - recording.time_s.front());
  EXPECT_TRUE(contains(run("supertac-info " + paths[0]).out, "mean_rate_hz                299.331\n"));
}

TEST_F(Export, SaysWhatItCannotExport) {
  succeed(small_simulation("sim"));
  const std::string recording = list_recordings(path("sim")).at(0);
  expect_failure(run("supertac-export " + recording + " --onnx m.onnx"), 1,
                 "give a file that supertac-train wrote");
  EXPECT_FALSE(std::filesystem::exists(path("m.onnx")));
  expect_failure(run("supertac-export " + recording), 2,
                 "expected one of --onnx FILE and --c99 DIR, found none");
}

TEST_F(Simulate, SameSeedSameBytesForAnyThreads) {
  for (const std::string threads : {"1", "3"})
    succeed(small_simulation(threads) + "--seed 5 --threads " + threads);
  for (const std::string pass : {"/ridges6_t1_p1_v10.safetensors", "/ridges6_t1_p2_v10.safetensors"})
    EXPECT_EQ(bytes("1" + pass), bytes("3" + pass));
}

TEST_F(Simulate, KeepsExistingFilesWithoutForce) {
  make_directories(path("sim"));
  const std::string existing = path("sim/ridges6_t1_p2_v10.safetensors");
  write_file(existing, "mine");
  expect_failure(run(small_simulation("sim")), 1, "exists already");
  EXPECT_EQ(bytes("sim/ridges6_t1_p2_v10.safetensors"), "mine");
  EXPECT_FALSE(std::filesystem::exists(path("sim/ridges6_t1_p1_v10.safetensors")));
  succeed(small_simulation("sim") + "--force");
  EXPECT_NO_THROW(read_recording(existing));
}

TEST_F(Simulate, AWrongCommandLineIsCode2) {
  expect_failure(run("supertac-simulate"), 2, "missing --out DIR");
  const std::pair<std::string, std::string> cases[] = {
      {"--sede 3", "did you mean '--seed'?"},
      {"--passes 9", "--passes: expected a whole number from 1 to 8, found '9'"},
      {"--speeds 0", "--speeds: expected numbers from 0.5 to 50, found '0'"},
      {"--speeds 1,5e", "found '5e'"},
      {"--plates moon", "moon"},
      {"--threads 0", "--threads: expected a whole number from 1 to 1024"}};
  for (const auto& [options, text] : cases) {
    expect_failure(run("supertac-simulate --out sim " + options), 2, text);
    EXPECT_EQ(folder_->entries(), 0u) << text;
  }
}

TEST_F(Simulate, ASignalRemovesWhatWasMadeAndTellsSo) {
  for (const int signal : {SIGINT, SIGTERM}) {
    const auto result =
        run("supertac-simulate --out sim --trials 200", {.signal = signal, .signal_when = path("*")});
    expect_failure(result, 128 + signal, "stopped by signal");
    EXPECT_EQ(folder_->entries(), 0u);
  }
}

TEST_F(Output, PlacesThatCannotBeWritten) {
  write_file(path("file"), "x");
  expect_failure(run(small_simulation(path("file"))), 1, path("file"));
  expect_failure(run(small_simulation("file/sim")), 1, "Not a directory");
  expect_failure(run(small_simulation("/proc/supertac")), 1, "/proc/supertac");
  if (geteuid() != 0) {  // root may write anywhere
    make_directories(path("locked"));
    std::filesystem::permissions(path("locked"), std::filesystem::perms::owner_read);
    expect_failure(run(small_simulation("locked/sim")), 1, "permissions");
    std::filesystem::permissions(path("locked"), std::filesystem::perms::owner_all);
  }
  EXPECT_EQ(bytes("file"), "x");
}

TEST_F(Output, ADiskThatFillsUpLeavesNothing) {
  // The first recording has some 130 kB.
  expect_failure(run(small_simulation("sim"), {.max_file_bytes = 50'000}), 1, "cannot write: File too large");
  EXPECT_EQ(folder_->entries(), 0u);
}

TEST_F(Output, JsonIsWrittenAtomicallyAndNotOverAnother) {
  succeed(small_simulation("sim") + "--json report.json");
  const std::string report = bytes("report.json");
  EXPECT_EQ(nlohmann::json::parse(report)["recordings"], 2);
  expect_failure(run(small_simulation("again") + "--json report.json"), 1, "report.json: exists already");
  EXPECT_FALSE(std::filesystem::exists(path("again")));
  EXPECT_EQ(bytes("report.json"), report);
}

TEST_F(Import, ReportsEveryFile) {
  make_directories(path("text/3_Bumps/1"));
  const std::string nine_hundred = text_of(make_recording({.frames = 900}));
  write_file(path("text/3_Bumps/1/1.txt"), nine_hundred + "1 2 3\n" + nine_hundred);
  const ProcessResult result = succeed("supertac-import text --out out --json j");
  EXPECT_TRUE(contains(result.out, "3_Bumps/1/1.txt  1801 lines, 1 dropped, "));
  EXPECT_TRUE(contains(result.out, "not reliable"));  // it feels no plate
  const auto report = json("j");
  EXPECT_EQ(report["files"][0]["dropped"], 1);
  const auto recording = read_recording(path("out/3_Bumps_t1_p1_v10.safetensors"));
  EXPECT_EQ(recording.frames(), 1800u);
  EXPECT_EQ(recording.metadata.at("registration_reliable"), "no");
}

TEST_F(Info, SendsNoControlCodesToTheTerminal) {
  std::string header = R"({"__metadata__":{"a\u001b[31m":"b\n\u001b]0;x"}})";
  header.resize(64, ' ');
  write_file(path("a"), std::string("\x40\0\0\0\0\0\0\0", 8) + header);
  const ProcessResult result = succeed("supertac-info a");
  EXPECT_FALSE(contains(result.out, "\x1b"));
  EXPECT_TRUE(contains(result.out, "absent: written by another program, damage cannot be seen\n"));
}

TEST_F(Dispatcher, RunsTheProgramsNextToIt) {
  EXPECT_EQ(run("supertac").code, 2);
  expect_failure(run("supertac simulat"), 2, "unknown job simulat (supertac --help lists them)");
  EXPECT_TRUE(contains(run("supertac info --version").out, "supertac-info "));
  expect_failure(run("supertac info"), 2, "missing FILE");
}

TEST_F(Dispatcher, HelpIsThatOfTheJobOrTheGlossary) {
  EXPECT_EQ(run("supertac help info").out, run("supertac-info --help").out);
  EXPECT_EQ(run("supertac help").out, run("supertac --help").out);
  expect_failure(run("supertac help inf"), 2, "unknown job inf");
  const std::string glossary = run("supertac help glossary").out;
  for (const char* term : {"taxel", "window", "pass", "trial", "split", "normalised per window", "latent",
                           "contact", "SSIM", "ghost rate"})
    EXPECT_TRUE(contains(glossary, "**" + std::string(term) + "** - "));
  EXPECT_TRUE(contains(run("supertac --help").out, "supertac help glossary"));
}

TEST_F(Dispatcher, EveryProgramOfTheListIsThereAndSaysWhatItIsFor) {
  std::istringstream lines(run("supertac --help").out);
  std::size_t programs = 0;
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with("  ") || line.starts_with("  supertac")) continue;
    const std::string job = line.substr(2, line.find(' ', 2) - 2), program = "supertac-" + job;
    const std::string purpose = line.substr(14);
    const ProcessResult help = succeed(program + " --help");
    EXPECT_TRUE(help.out.starts_with(purpose)) << program << ": " << help.out;
    EXPECT_TRUE(contains(help.out, "Usage:\n  " + program));
    const ProcessResult version = run(program + " --version");
    EXPECT_TRUE(version.out.starts_with(program + " ")) << version.out;
    for (const char* text : {"commit ", "compiler  "}) EXPECT_TRUE(contains(version.out, text));
    ++programs;
  }
  EXPECT_GE(programs, 10u);
}

}  // namespace supertac::programs_test
