// supertac-rig, supertac-collect, supertac-import --journal and supertac-plate together, as on a table.
#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "data/windows/windows.h"
#include "io/files/file.h"
#include "tests/apps/common/process.h"

namespace supertac {
namespace {

constexpr std::uint64_t kPlenty = 1 << 26;

/// A virtual rig with a printed plate, four times faster than a real one.
class RigTest : public testing::Test {
 protected:
  RigTest() {
    setenv("XDG_STATE_HOME", (folder_ / "state").c_str(), 1);
    const auto made = run_process("supertac-plate", {"--plate", "ridges9", "--out", folder_ / "my.stl"});
    if (made.code != 0) throw std::runtime_error(made.error);
    rig_ = std::make_unique<RunningProcess>(
        "supertac-rig",
        std::vector<std::string>{"--plate", folder_ / "my.stl", "--board-link", folder_ / "board",
                                 "--printer-link", folder_ / "printer", "--speedup", "4"});
    wait_for_file(folder_ / "board");
    wait_for_file(folder_ / "printer");
  }
  std::vector<std::string> collect(const std::string& out, const std::string& speed) {
    return {"--board",   folder_ / "board",
            "--printer", folder_ / "printer",
            "--plate",   folder_ / "my.stl",
            "--passes",  "1",
            "--speed",   speed,
            "--out",     folder_ / out,
            "--speedup", "4",
            "--yes"};
  }
  TemporaryFolder folder_;
  std::unique_ptr<RunningProcess> rig_;
};

TEST_F(RigTest, CollectShowsALiveLineAndReportsEveryPass) {
  auto arguments = collect("out", "50");
  arguments.insert(arguments.end(), {"--json", folder_ / "report.json"});
  const ProcessResult collected = run_process("supertac-collect", arguments, {.terminal = true});
  ASSERT_EQ(collected.code, 0) << collected.error;
  EXPECT_NE(collected.out.find("pass 1: "), std::string::npos) << collected.out;
  for (const char* part : {"collecting  [", " frames/s  ", " lost", "X99.7 Y"})
    EXPECT_NE(collected.error.find(part), std::string::npos) << part << " in " << collected.error;
  const auto report = nlohmann::json::parse(read_text_file(folder_ / "report.json", kPlenty));
  EXPECT_EQ(report["plate"], "my.stl");
  EXPECT_EQ(report["complete"], true);
  EXPECT_EQ(report["passes_done"], 1);
  ASSERT_EQ(report["passes"].size(), 1u);
  const auto& pass = report["passes"][0];
  EXPECT_EQ(pass["complete"], true);
  // About what the board sends: on a machine that stands still frames whose time is uncertain are left out.
  const double sent = pass["frames"].get<double>() - 1 + pass["missing"].get<double>();
  EXPECT_NEAR(sent / pass["seconds"].get<double>(), 1008, 504);
  EXPECT_GT(pass["positions"], 10);
  const Recording recording = read_recording(folder_ / ("out/" + pass["file"].get<std::string>()));
  EXPECT_EQ(pass["frames"], recording.frames());
  EXPECT_EQ(recording.plate, "my.stl");
  // At first the finger is in the air: at rest, however long this machine has been running.
  for (std::size_t k = 0; k < kTaxels; ++k) EXPECT_NEAR(recording.volts[k], 2.44, 0.05) << "taxel " << k;
  // The folder holds its plate: truths can be drawn wherever it is moved.
  std::filesystem::rename(folder_ / "out", folder_ / "moved");
  std::filesystem::remove(folder_ / "my.stl");
  EXPECT_GT(WindowSet::load(folder_ / "moved", {}, {.timesteps = 32}).size(), 100u);
}

TEST_F(RigTest, ACollectionThatWasKilledIsRecoveredByImport) {
  RunningProcess process("supertac-collect", collect("out", "10"));
  const std::string journal = folder_ / "out/my.stl_t1_v10.journal";
  wait_for_file(journal, 2'500'000);
  process.send(SIGKILL);
  EXPECT_EQ(process.wait().code, 128 + SIGKILL);
  const ProcessResult recovered =
      run_process("supertac-import",
                  {"--journal", journal, "--out", folder_ / "saved", "--json", folder_ / "saved.json"});
  ASSERT_EQ(recovered.code, 0) << recovered.error;
  EXPECT_NE(recovered.out.find("the collection was cut off"), std::string::npos) << recovered.out;
  const Recording recording = read_recording(folder_ / "saved/my.stl_t1_p1_v10.safetensors");
  EXPECT_EQ(recording.metadata.at("complete"), "false");
  EXPECT_EQ(read_file(folder_ / "saved/my.stl", kPlenty), read_file(folder_ / "my.stl", kPlenty));
  const auto report = nlohmann::json::parse(read_text_file(folder_ / "saved.json", kPlenty));
  EXPECT_EQ(report["complete"], false);
  EXPECT_EQ(report["frames"], recording.frames());
  const auto again = run_process("supertac-import", {"--journal", journal, "--out", folder_ / "saved"});
  EXPECT_EQ(again.code, 1);
  EXPECT_NE(again.error.find("--force"), std::string::npos) << again.error;
}

TEST(ImportJournal, RefusesWhatIsNoJournalAndMixedOptions) {
  const TemporaryFolder folder;
  const std::string journal = folder / "a.journal", out = folder / "out";
  write_file(journal, std::string("not a journal"));
  const auto wrong = run_process("supertac-import", {"--journal", journal, "--out", out});
  EXPECT_EQ(wrong.code, 1);
  EXPECT_NE(wrong.error.find("a.journal"), std::string::npos) << wrong.error;
  EXPECT_FALSE(std::filesystem::exists(out));
  EXPECT_EQ(run_process("supertac-import", {folder.path(), "--journal", journal, "--out", out}).code, 2);
  EXPECT_EQ(run_process("supertac-import", {"--out", out}).code, 2);
}

}  // namespace
}  // namespace supertac
