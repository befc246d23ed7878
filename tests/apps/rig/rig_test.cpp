// supertac-rig, supertac-collect, supertac-import --journal and supertac-plate together, as on a table.
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "data/windows/windows.h"
#include "io/files/file.h"
#include "tests/apps/common/expect.h"
#include "tests/support/test.h"

namespace supertac::rig_rig_test {

/// A virtual rig with a printed plate, four times faster than a real one.
class RigTest : public ProgramTest {
 protected:
  RigTest() {
    setenv("XDG_STATE_HOME", path("state").c_str(), 1);
    wait_for_file(path("board"));
    wait_for_file(path("printer"));
  }
  // Of one pass.
  const std::string collect_ =
      "supertac-collect --board board --printer printer --plate my.stl --passes 1 --speedup 4 --yes --out "
      "out ";

 private:
  ProcessResult plate_ = succeed("supertac-plate --plate ridges9 --out my.stl");
  RunningProcess rig_ =
      start("supertac-rig --plate my.stl --board-link board --printer-link printer --speedup 4");
};

TEST_F(RigTest, CollectShowsALiveLineAndReportsEveryPass) {
  const ProcessResult collected = succeed(collect_ + "--speed 50 --json report.json", {.terminal = true});
  EXPECT_TRUE(contains(collected.out, "pass 1: "));
  for (const char* part : {"collecting  [", " frames/s  ", " lost", "X99.7 Y"})
    EXPECT_TRUE(contains(collected.error, part));
  const auto report = json("report.json");
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
  const Recording recording = read_recording(path("out/" + pass["file"].get<std::string>()));
  EXPECT_EQ(pass["frames"], recording.frames());
  EXPECT_EQ(recording.plate, "my.stl");
  // At first the finger is in the air: at rest, however long this machine has been running.
  for (std::size_t k = 0; k < rig::kTaxels; ++k)
    EXPECT_NEAR(recording.signals[k], 2.44, 0.05) << "taxel " << k;
  succeed("supertac-import --journal out/my.stl_t1_v50.journal --out saved");
  EXPECT_EQ(bytes("saved/my.stl"), bytes("my.stl"));
  // The folder holds its plate: truths can be drawn wherever it is moved.
  std::filesystem::rename(path("out"), path("moved"));
  std::filesystem::remove(path("my.stl"));
  EXPECT_GT(WindowSet::load(path("moved"), {}, {.timesteps = 32}).size(), 100u);
}

using ImportJournal = ProgramTest;

TEST_F(ImportJournal, RefusesWhatIsNoJournalAndMixedOptions) {
  const std::string journal = path("a.journal"), out = path("out");
  write_file(journal, std::string("not a journal"));
  expect_exit(run("supertac-import --journal " + journal + " --out " + out), 1, "a.journal");
  EXPECT_FALSE(std::filesystem::exists(out));
  EXPECT_EQ(run("supertac-import . --journal " + journal + " --out " + out).code, 2);
  EXPECT_EQ(run("supertac-import --out " + out).code, 2);
}

}  // namespace supertac::rig_rig_test
