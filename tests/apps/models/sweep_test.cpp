// supertac-sweep as a process: a small grid, going on after an end, damaged tables.

#include <csignal>
#include <sstream>

#include "io/files/safetensors.h"
#include "io/numbers/text.h"
#include "tests/apps/common/expect.h"
#include "tests/support/test.h"

namespace supertac::sweep_test {

namespace fs = std::filesystem;

class Sweep : public OnSimulatedData {
 protected:
  // Of two models: T 32 and 64, x2.
  static std::string line(const std::string& out, const std::string& more = "") {
    return "supertac-sweep --out " + out +
           " --data data --preset tiny --rate 100 --latent 2 --scale 2 --timesteps 32,64 --batch 8 --stride "
           "8 --threads 1 --limit 50 --epochs 1 " +
           more;
  }
  // The cells of a column of a table, without its head.
  static std::vector<std::string> column_of(const std::string& csv, const std::string& name) {
    std::vector<std::string> values, head;
    std::istringstream lines(csv);
    for (std::string line; std::getline(lines, line);) {
      const std::vector<std::string> cells = comma_list(line);
      if (head.empty()) head = cells;
      values.push_back(cells.at(static_cast<std::size_t>(std::ranges::find(head, name) - head.begin())));
    }
    values.erase(values.begin());
    return values;
  }
};

TEST_F(Sweep, WritesARowAModelAndDoesNotRepeatIt) {
  const ProcessResult first = succeed(line("grid"));
  EXPECT_TRUE(contains(first.out, "Pareto front, fastest first:\n  tiny_t32_l2_x2: SSIM "));
  const std::string csv = bytes("grid/sweep.csv");
  const std::vector<std::string> names = {"tiny_t32_l2_x2_s0", "tiny_t64_l2_x2_s0"};
  EXPECT_EQ(column_of(csv, "model"), names);
  EXPECT_EQ(column_of(csv, "timesteps"), (std::vector<std::string>{"32", "64"}));
  for (const std::string& name : names) EXPECT_TRUE(fs::exists(path("grid/models/" + name + ".safetensors")));
  EXPECT_FALSE(contains(succeed(line("grid")).error, "training on"));
  EXPECT_EQ(bytes("grid/sweep.csv"), csv);

  // It trains as supertac-train does: one model can be trained again without the others.
  const std::string model = path("grid/models/" + names[1] + ".safetensors");
  succeed("supertac-train --data data --out same.safetensors --threads 1 --recipe-of " + model);
  EXPECT_EQ(content_hash(SafetensorsFile::read(path("same.safetensors"))),
            content_hash(SafetensorsFile::read(model)));

  const std::string beginning = "this sweep began with ";
  expect_failure(run(line("grid", "--epochs 2")), 1, beginning);
  fs::rename(path("data"), path("before"));  // the same names, other recordings
  succeed("supertac-simulate --out data --plates 3_Bumps --speeds 10 --passes 1 --seed 2");
  const ProcessResult other = run(line("grid"));
  fs::remove_all(path("data"));
  fs::rename(path("before"), path("data"));
  expect_failure(other, 1, beginning);
}

TEST_F(Sweep, HistoryJudgesModelsOnTheSameFrames) {
  succeed(line("history", "--history 1440 --limit 0"));
  const auto windows = column_of(bytes("history/sweep.csv"), "all_windows");
  ASSERT_EQ(windows.size(), 2U);
  EXPECT_EQ(windows[0], windows[1]) << "the longer windows end 32 frames later where nothing is left out";
  expect_exit(run(line("none", "--history 100000")), 2, "--history 100000 leaves none of the ");
}

TEST_F(Sweep, AStoppedModelGoesOnToTheSameBytes) {
  const std::string often = "--epochs 8 --checkpoint-every 5";
  succeed(line("whole", often));
  const std::string model = "/models/tiny_t32_l2_x2_s0";
  const ProcessResult stopped =
      run(line("stopped", often),
          {.signal = SIGINT, .signal_when = path("stopped" + model + ".run/last.safetensors")});
  EXPECT_EQ(stopped.code, 128 + SIGINT) << stopped.error;
  EXPECT_FALSE(fs::exists(path("stopped" + model + ".safetensors")));
  EXPECT_TRUE(contains(succeed(line("stopped", often)).error, "resumed at"));
  EXPECT_TRUE(bytes("whole" + model + ".safetensors") == bytes("stopped" + model + ".safetensors"));
}

// A model for each kind of object, which has not seen it.
TEST_F(Sweep, LeavesOutEachGroupInTurn) {
  write_file(path("pad.json"),
             R"({"rows": 3, "columns": 4, "pitch_mm": 5, "pressed": "higher", "unit": "counts",
    "range": [0, 900], "rate_hz": 50, "frame": {"kind": "text"}})");
  succeed("supertac-simulate --sensor pad.json --presses 40 --scale 2 --out pressed");
  const ProcessResult ran = succeed(
      "supertac-sweep --out each --data pressed --preset frame --scale 2 --split group --leave-out each "
      "--epochs 1 --batch 32 --threads 1 --limit 20");
  const std::vector<std::string> kinds = {"bar",      "disc",     "edge",     "fingertip", "letter",
                                          "mixed",    "ring",     "surface1", "surface2",  "surface3",
                                          "surface4", "surface5", "surface6", "surface7"};
  EXPECT_EQ(column_of(bytes("each/sweep.csv"), "left_out"), kinds);
  EXPECT_TRUE(
      contains(ran.out, std::to_string(kinds.size()) + " model(s)\nEach left out in turn, the worst"));
  double before = -1;
  std::istringstream lines(ran.out.substr(ran.out.find("Each left out")));
  std::string one;
  std::getline(lines, one);
  for (std::size_t i = 0; i + 1 < kinds.size() && std::getline(lines, one); ++i) {
    const double ssim = std::stod(one.substr(one.find("SSIM ") + 5));
    EXPECT_LE(before, ssim);
    before = ssim;
  }
  expect_exit(run(line("wrong", "--leave-out each")), 2, "--leave-out needs --split texture or group");
}

TEST_F(Sweep, BadInputIsOneLine) {
  succeed(line("bad", "--timesteps 32"));
  const std::string csv = bytes("bad/sweep.csv");
  write_file(path("bad/sweep.csv"), csv + "a_s0,paper,32\n");
  expect_failure(run(line("bad", "--timesteps 32")), 1, "line 3: expected the columns model,preset");
  expect_failure(run("supertac-sweep --out absent"), 2, "--data");
  EXPECT_EQ(run(line("bad2", "--seeds 0.5")).code, 2);
  EXPECT_EQ(run(line("bad2", "--preset huge")).code, 2);
  EXPECT_FALSE(fs::exists(path("bad2/sweep.csv")));
}

}  // namespace supertac::sweep_test
