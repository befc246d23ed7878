// supertac-sweep as a process: a small grid, going on after an end, damaged tables.
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <sstream>

#include "io/files/json.h"
#include "io/files/provenance.h"
#include "tests/apps/common/simulated_data.h"

namespace supertac {
namespace {

namespace fs = std::filesystem;

const std::string kHeader =
    "model,preset,timesteps,latent,scale,channels,rcabs,seed,split,left_out,windows,ssim,psnr_db,phase,phase_"
    "floor,"
    "position_mm,all_windows,all_ssim,all_psnr_db,all_phase,all_phase_floor,all_position_mm,median_us,p99_us,"
    "mmac,parameters,train_s,steps,commit";

// The cells of a column of the table, without its head.
std::vector<std::string> column_of(const std::string& csv, const std::string& name) {
  std::vector<std::string> values;
  std::istringstream lines(csv.substr(csv.find('\n') + 1));
  for (std::string line; std::getline(lines, line);) {
    std::istringstream columns(kHeader), cells(line);
    std::string value;
    for (std::string column; std::getline(columns, column, ',') && std::getline(cells, value, ',');)
      if (column == name) values.push_back(value);
  }
  return values;
}

class Sweep : public OnSimulatedData {
 protected:
  // Of two models: T 32 and 64, x2.
  static std::string line(const std::string& out, const std::string& more = "") {
    return "supertac-sweep --out " + out +
           " --data data --preset tiny --rate 100 --latent 2 --scale 2 --timesteps 32,64 --batch 8 --stride "
           "8 "
           "--threads 1 --limit 50 --epochs 1 " +
           more;
  }
  static ProcessResult sweep(const std::string& out, const std::string& more = "",
                             const ProcessOptions& how = {}) {
    return run(line(out, more), how);
  }
};

TEST_F(Sweep, WritesARowAModelAndDoesNotRepeatIt) {
  succeed(line("grid"));
  const std::string csv = bytes("grid/sweep.csv");
  EXPECT_EQ(csv.substr(0, csv.find('\n')), kHeader);
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 3);
  for (const char* name : {"tiny_t32_l2_x2_c8_r1_s0", "tiny_t64_l2_x2_c8_r1_s0"}) {
    EXPECT_TRUE(contains(csv, std::string("\n") + name + ",tiny,"));
    EXPECT_TRUE(fs::exists(path("grid/models/" + std::string(name) + ".safetensors")));
  }
  const std::string page = bytes("grid/chart.html");
  EXPECT_TRUE(contains(page, "Pareto front"));
  EXPECT_FALSE(contains(page, "<!--"));
  EXPECT_FALSE(contains(succeed(line("grid")).error, "training on"));
  EXPECT_EQ(bytes("grid/sweep.csv"), csv);

  const std::string beginning = "this sweep began with ";
  expect_exit(sweep("grid", "--epochs 2"), 1, beginning);
  expect_exit(sweep("grid", "--rate 90"), 1, "--rate 90");
  fs::rename(path("data"), path("before"));  // the same names, other recordings
  succeed("supertac-simulate --out data --plates 3_Bumps --speeds 10 --passes 1 --seed 2");
  const ProcessResult other = sweep("grid");
  fs::remove_all(path("data"));
  fs::rename(path("before"), path("data"));
  expect_exit(other, 1, beginning);
}

TEST_F(Sweep, HistoryJudgesModelsOnTheSameFrames) {
  succeed(line("history", "--history 1440"));
  const auto windows = column_of(bytes("history/sweep.csv"), "all_windows");
  ASSERT_EQ(windows.size(), 2U);
  EXPECT_EQ(windows[0], windows[1]);
  EXPECT_LT(std::stoi(windows[0]), 50) << "nothing was left out";

  expect_exit(sweep("none", "--history 100000"), 2, "--history 100000 leaves none of the ");
}

// Each at its own rate, so that windows of 64 samples span 0.64 s of one and 1.28 s of the other.
TEST_F(Sweep, PresetsOfOneTableAreTrainedAtTheirOwnRates) {
  succeed(
      "supertac-sweep --out presets --data data --preset paper,tiny --timesteps 64 "
      "--scale 2 --epochs 1 --stride 8 --threads 1");
  const auto windows = column_of(bytes("presets/sweep.csv"), "all_windows");
  ASSERT_EQ(windows.size(), 2U);
  EXPECT_GT(std::stoi(windows[0]), 1.8 * std::stoi(windows[1]));
}

TEST_F(Sweep, ACutLineIsDroppedAndItsModelMeasuredAgain) {
  succeed(line("cut"));
  const std::string csv = bytes("cut/sweep.csv");
  write_file(path("cut/sweep.csv"), std::string_view(csv).substr(0, csv.size() - 20));
  succeed(line("cut"));
  const std::string mended = bytes("cut/sweep.csv");
  EXPECT_EQ(std::count(mended.begin(), mended.end(), '\n'), 3);
  EXPECT_EQ(mended.substr(0, csv.rfind("tiny_t64")), csv.substr(0, csv.rfind("tiny_t64")));
}

TEST_F(Sweep, AStoppedModelGoesOnToTheSameBytes) {
  const std::string often = "--epochs 8 --checkpoint-every 5";
  succeed(line("whole", often));
  const std::string model = "/models/tiny_t64_l2_x2_c8_r1_s0";  // the longest is the first
  const ProcessResult stopped = sweep(
      "stopped", often, {.signal = SIGINT, .signal_when = path("stopped" + model + ".run/last.safetensors")});
  EXPECT_EQ(stopped.code, 128 + SIGINT) << stopped.error;
  EXPECT_FALSE(fs::exists(path("stopped" + model + ".safetensors")));
  EXPECT_TRUE(contains(succeed(line("stopped", often)).error, "resumed at"));
  EXPECT_TRUE(bytes("whole" + model + ".safetensors") == bytes("stopped" + model + ".safetensors"));
}

// A sweep trains as supertac-train does: one model can be trained again without the others.
TEST_F(Sweep, ItsModelsAreThoseOfSupertacTrain) {
  succeed(line("whole4", "--seeds 0,1"));
  succeed(
      "supertac-train --data data --out same.safetensors --like "
      "whole4/models/tiny_t64_l2_x2_c8_r1_s1.safetensors --threads 1");
  EXPECT_EQ(content_hash(SafetensorsFile::read(path("same.safetensors"))),
            content_hash(SafetensorsFile::read(path("whole4/models/tiny_t64_l2_x2_c8_r1_s1.safetensors"))));
}

// Each row is of the front unless another is both faster and more accurate.
TEST_F(Sweep, ReportsTheParetoFrontOfMeansOverSeeds) {
  succeed(line("front", "--timesteps 32 --seeds 0,1 --json front.json"));
  const std::string csv = bytes("front/sweep.csv");
  const auto row = [&](const std::string& name, const std::string& ssim, const std::string& us) {
    std::istringstream columns(kHeader);
    std::string line;
    for (std::string column; std::getline(columns, column, ',');)
      line += (line.empty() ? "" : ",") + (column == "model"       ? name
                                           : column == "left_out"  ? ""
                                           : column == "ssim"      ? ssim
                                           : column == "median_us" ? us
                                                                   : std::string("1"));
    return line + "\n";
  };
  write_file(path("front/sweep.csv"), csv + row("slow_s0", "1.88", "1e6") + row("slow_s1", "1.92", "3e6") +
                                          row("worse_s0", "1.5", "4e6") + row("empty_s0", "nan", "1e-3"));
  succeed(line("front", "--timesteps 32 --seeds 0,1 --json front.json --force"));
  const auto json = parse_json_limited(bytes("front.json"));
  EXPECT_EQ(json["configurations"], 4);
  ASSERT_EQ(json["front"].size(), 2);
  EXPECT_EQ(json["front"][0]["seeds"], 2);
  EXPECT_EQ(json["front"][1]["configuration"], "slow");
  EXPECT_DOUBLE_EQ(json["front"][1]["ssim"].get<double>(), 1.9);
  EXPECT_DOUBLE_EQ(json["front"][1]["median_us"].get<double>(), 2e6);
}

// A model for each kind of object, which has not seen it.
TEST_F(Sweep, LeavesOutEachGroupInTurn) {
  write_file(path("pad.json"),
             R"({"rows": 3, "columns": 4, "pitch_mm": 5, "pressed": "higher", "unit": "counts",
    "range": [0, 900], "rate_hz": 50, "frame": {"kind": "text"}})");
  succeed("supertac-simulate --sensor pad.json --presses 40 --scale 2 --out pressed");
  const std::string each =
      "supertac-sweep --out each --data pressed --preset frame --scale 2 --split group --leave-out each "
      "--epochs 1 --batch 32 --threads 1 --limit 20 --json each.json";
  const ProcessResult ran = succeed(each);
  const std::vector<std::string> kinds = {"bar",      "disc",     "edge",     "fingertip", "letter",
                                          "mixed",    "ring",     "surface1", "surface2",  "surface3",
                                          "surface4", "surface5", "surface6", "surface7"};
  EXPECT_EQ(column_of(bytes("each/sweep.csv"), "left_out"), kinds);
  EXPECT_TRUE(contains(bytes("each/chart.html"), "Each left out in turn"));
  const auto json = parse_json_limited(bytes("each.json"));
  EXPECT_EQ(json["configurations"], 1) << "one mean over all that were left out";
  ASSERT_EQ(json["left_out"].size(), kinds.size());
  for (std::size_t i = 0; i + 1 < kinds.size(); ++i)
    EXPECT_LE(json["left_out"][i]["ssim"].get<double>(), json["left_out"][i + 1]["ssim"].get<double>());
  for (const std::string& kind : kinds) EXPECT_TRUE(contains(ran.out, "_s0_" + kind + ": SSIM ")) << kind;
  expect_exit(sweep("wrong", "--leave-out each"), 2, "--leave-out needs --split texture or group");
}

TEST_F(Sweep, BadInputIsOneLine) {
  succeed(line("bad", "--timesteps 32"));
  const std::string csv = bytes("bad/sweep.csv");
  write_file(path("bad/sweep.csv"), csv + "a_s0,paper,32\n");
  expect_failure(sweep("bad", "--timesteps 32"), 1, "line 3: expected the columns model,preset");
  write_file(path("bad/sweep.csv"), "model,ssim\n");
  expect_failure(sweep("bad", "--timesteps 32"), 1, "line 1: expected the columns model,preset");
  EXPECT_EQ(run("supertac-sweep --out absent").code, 2);
  EXPECT_EQ(sweep("bad2", "--seeds 0.5").code, 2);
  EXPECT_EQ(sweep("bad2", "--preset huge").code, 2);
  EXPECT_FALSE(fs::exists(path("bad2/sweep.csv")));
}

}  // namespace
}  // namespace supertac
