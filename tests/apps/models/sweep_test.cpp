// supertac-sweep as a process: a small grid, going on after an end, damaged tables, the choice among rows.
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <map>
#include <sstream>

#include "io/files/json.h"
#include "io/files/provenance.h"
#include "tests/apps/common/simulated_data.h"

namespace supertac {
namespace {

namespace fs = std::filesystem;

const std::string kHeader =
    "model,preset,timesteps,latent,scale,channels,rcabs,seed,split,windows,ssim,psnr_db,psnr_pooled_db,phase,"
    "phase_floor,position_px,position_mm,all_windows,all_ssim,all_psnr_db,all_psnr_pooled_db,all_phase,"
    "all_phase_floor,all_position_px,all_position_mm,median_us,p99_us,mmac,parameters,memory_mb,train_s,"
    "steps,commit";

// A row of kHeader's columns: 1 in every cell but those given.
std::string row(const std::map<std::string, std::string>& cells) {
  std::string line;
  std::istringstream columns(kHeader);
  for (std::string column; std::getline(columns, column, ',');) {
    const auto found = cells.find(column);
    line += (line.empty() ? "" : ",") + (found == cells.end() ? "1" : found->second);
  }
  return line + "\n";
}

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
  // Of two models: T 32 and 64, x2, eight channels, one RCAB.
  static std::string line(const std::string& out, const std::string& more = "") {
    return "supertac-sweep --out " + out +
           " --data data --latent 2 --scale 2 --timesteps 32,64 --channels 8 --rcabs 1 --batch 8 --stride 8 "
           "--threads 1 --limit 50 --epochs 1 " +
           more;
  }
  static ProcessResult sweep(const std::string& out, const std::string& more = "",
                             const ProcessOptions& how = {}) {
    return run(line(out, more), how);
  }
  static ProcessResult pick(const std::string& out, const std::string& conditions) {
    return run("supertac-sweep --out " + out + " --pick " + conditions + " --force --json " + out + ".json");
  }

  // A table without models behind it.
  static void write_table(const std::string& out, const std::string& rows) {
    fs::create_directories(path(out));
    write_file(path(out) + "/sweep.csv", kHeader + "\n" + rows);
  }
};

TEST_F(Sweep, WritesARowAModelAndDoesNotRepeatIt) {
  succeed(line("grid"));
  const std::string csv = bytes("grid/sweep.csv");
  EXPECT_EQ(csv.substr(0, csv.find('\n')), kHeader);
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 3);
  for (const char* name : {"paper_t32_l2_x2_c8_r1_s0", "paper_t64_l2_x2_c8_r1_s0"}) {
    EXPECT_TRUE(contains(csv, std::string("\n") + name + ",paper,"));
    EXPECT_TRUE(fs::exists(path("grid/models/" + std::string(name) + ".safetensors")));
  }
  const std::string page = bytes("grid/chart.html");
  EXPECT_TRUE(contains(page, "Pareto front"));
  EXPECT_FALSE(contains(page, "<!--"));
  EXPECT_FALSE(contains(succeed(line("grid")).error, "training on"));
  EXPECT_EQ(bytes("grid/sweep.csv"), csv);

  const std::string beginning = "this sweep began with ";
  expect_exit(sweep("grid", "--epochs 2"), 1, beginning + "epochs \"1\", now it is \"2\"");
  expect_exit(sweep("grid", "--rate 100"), 1, beginning + "rate \"the preset's\", now it is \"100\"");
  fs::rename(path("data"), path("before"));  // the same names, other recordings
  succeed("supertac-simulate --out data --plates 3_Bumps --speeds 10 --passes 1 --seed 2");
  const ProcessResult other = sweep("grid");
  fs::remove_all(path("data"));
  fs::rename(path("before"), path("data"));
  expect_exit(other, 1, beginning + "data ");
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
      "supertac-sweep --out presets --data data --preset paper,tiny --timesteps 64 --channels 8 --rcabs 1 "
      "--scale 2 --epochs 1 --stride 8 --threads 1");
  const auto windows = column_of(bytes("presets/sweep.csv"), "all_windows");
  ASSERT_EQ(windows.size(), 2U);
  EXPECT_GT(std::stoi(windows[0]), 1.8 * std::stoi(windows[1]));
}

TEST_F(Sweep, ACutLineIsDroppedAndItsModelMeasuredAgain) {
  succeed(line("cut"));
  const std::string csv = bytes("cut/sweep.csv");
  write_file(path("cut/sweep.csv"), std::string_view(csv).substr(0, csv.size() - 20));
  EXPECT_TRUE(contains(succeed(line("cut")).error, "the last line was cut off"));
  const std::string mended = bytes("cut/sweep.csv");
  EXPECT_EQ(std::count(mended.begin(), mended.end(), '\n'), 3);
  EXPECT_EQ(mended.substr(0, csv.rfind("paper_t64")), csv.substr(0, csv.rfind("paper_t64")));
}

TEST_F(Sweep, AStoppedModelGoesOnToTheSameBytes) {
  const std::string often = "--epochs 8 --checkpoint-every 5";
  succeed(line("whole", often));
  const std::string model = "/models/paper_t64_l2_x2_c8_r1_s0";  // the longest is the first
  const ProcessResult stopped = sweep(
      "stopped", often, {.signal = SIGINT, .signal_when = path("stopped" + model + ".run/last.safetensors")});
  EXPECT_EQ(stopped.code, 128 + SIGINT) << stopped.error;
  EXPECT_FALSE(fs::exists(path("stopped" + model + ".safetensors")));
  EXPECT_TRUE(contains(succeed(line("stopped", often)).error, "resumed at"));
  EXPECT_TRUE(bytes("whole" + model + ".safetensors") == bytes("stopped" + model + ".safetensors"));
}

// Everything but times and memory, which are never the same.
std::string without_times(const std::string& csv) {
  std::string kept;
  std::istringstream columns(kHeader);
  for (std::string column; std::getline(columns, column, ',');)
    if (column != "median_us" && column != "p99_us" && column != "memory_mb" && column != "train_s")
      for (const std::string& cell : column_of(csv, column)) kept += cell + ",";
  return kept;
}

TEST_F(Sweep, ProcessesOfOneFolderShareTheTrainingsAndTakeOverFromALostOne) {
  succeed(line("one", "--seeds 0,1"));
  const std::string expected = without_times(bytes("one/sweep.csv"));
  EXPECT_EQ(column_of(bytes("one/sweep.csv"), "model").size(), 4U);
  const auto start = [](const std::string& out) {
    return start_in(folder_->path(), line(out, "--seeds 0,1"));
  };
  RunningProcess first = start("two"), second = start("two");
  const ProcessResult a = first.wait(), b = second.wait();
  EXPECT_EQ(a.code + b.code, 0) << a.error << b.error;
  EXPECT_EQ(without_times(bytes("two/sweep.csv")), expected);
  EXPECT_TRUE(contains(a.error, "of 4 paper")) << "the second did it all";
  EXPECT_TRUE(contains(b.error, "of 4 paper")) << "the first did it all";
  RunningProcess lost = start("left");
  wait_for_file(path("left/models/paper_t64_l2_x2_c8_r1_s0.run/log.csv"));
  RunningProcess other = start("left");
  wait_for_file(path("left/models/paper_t64_l2_x2_c8_r1_s1.run/log.csv"));
  lost.send(SIGKILL);
  EXPECT_EQ(lost.wait().code, 128 + SIGKILL);
  const ProcessResult left = other.wait();
  EXPECT_EQ(left.code, 0) << left.error;
  EXPECT_EQ(without_times(bytes("left/sweep.csv")), expected);
}

// A frozen process keeps its folder's lock for ever.
TEST_F(Sweep, AFrozenProcessIsGivenUp) {
  const std::string words = line("frozen", "--timesteps 32 --epochs 50 --deadline 2");
  RunningProcess frozen = start_in(folder_->path(), words);
  wait_for_file(path("frozen/models/paper_t32_l2_x2_c8_r1_s0.run/log.csv"));
  frozen.send(SIGSTOP);
  const auto begin = std::chrono::steady_clock::now();
  expect_exit(run(words), 1, "have written nothing for 2 s; end those that are frozen");
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(200));
}

// A sweep trains as supertac-train does: one model can be trained again without the others.
TEST_F(Sweep, ItsModelsAreThoseOfSupertacTrain) {
  succeed(line("whole4", "--seeds 0,1"));
  succeed(
      "supertac-train --data data --out same.safetensors --like "
      "whole4/models/paper_t64_l2_x2_c8_r1_s1.safetensors --threads 1");
  EXPECT_EQ(content_hash(SafetensorsFile::read(path("same.safetensors"))),
            content_hash(SafetensorsFile::read(path("whole4/models/paper_t64_l2_x2_c8_r1_s1.safetensors"))));
}

TEST_F(Sweep, PicksTheFastestConfigurationThatHolds) {
  // Means over two seeds: slow .9, middle .8, bad .7 (slower and worse than middle), fast .5.
  write_table("made",
              row({{"model", "slow_s0"}, {"median_us", "90"}, {"ssim", "0.88"}}) +
                  row({{"model", "slow_s1"}, {"median_us", "110"}, {"ssim", "0.92"}}) +
                  row({{"model", "middle_s0"}, {"median_us", "50"}, {"ssim", "0.8"}}) +
                  row({{"model", "bad_s0"}, {"median_us", "60"}, {"ssim", "0.7"}}) +
                  row({{"model", "fast_s0"}, {"median_us", "10"}, {"ssim", "0.5"}, {"position_mm", "3"}}) +
                  row({{"model", "empty_s0"}, {"median_us", "1"}, {"ssim", "nan"}}));
  const std::vector<std::pair<std::string, std::string>> cases{{"ssim>=0.8", "middle"},
                                                               {"ssim>0.8", "slow"},
                                                               {"ssim<=0.9", "fast"},
                                                               {"ssim>0.4,position_mm<2", "middle"},
                                                               {"median_us<50", "empty"}};
  for (const auto& [conditions, expected] : cases) {
    const ProcessResult result = pick("made", conditions);
    ASSERT_EQ(result.code, 0) << result.error;
    const auto json = parse_json_limited(bytes("made.json"));
    EXPECT_EQ(json["pick"]["configuration"], expected) << conditions;
    ASSERT_EQ(json["front"].size(), 3) << result.out;
    EXPECT_EQ(json["front"][0]["configuration"], "fast");
    EXPECT_EQ(json["front"][1]["configuration"], "middle");
    EXPECT_EQ(json["front"][2]["configuration"], "slow");
    EXPECT_EQ(json["front"][2]["seeds"], 2);
    EXPECT_DOUBLE_EQ(json["front"][2]["ssim"].get<double>(), 0.9);
  }
  expect_exit(pick("made", "ssim>=0.99"), 1, "no configuration meets ssim>=0.99");
}

TEST_F(Sweep, BadInputIsOneLine) {
  const std::string good = row({{"model", "a_s0"}, {"ssim", "0.5"}});
  struct Bad {
    std::string rows, message;
  };
  const std::vector<Bad> tables{
      {"a_s0,paper,32\n" + good, "line 2: expected 33 cells, found 3"},
      {good + good, "line 3: model a_s0 is there twice"},
      {row({{"model", "a_s0"}, {"ssim", "high"}}), "line 2: ssim expects a number"}};
  for (const Bad& bad : tables) {
    write_table("bad", bad.rows);
    expect_failure(pick("bad", "ssim>=0.1"), 1, bad.message);
  }
  write_file(path("bad/sweep.csv"), "model,ssim\n");
  EXPECT_TRUE(contains(pick("bad", "ssim>=0.1").error, "line 1: expected the columns"));

  for (const char* conditions :
       {"ssim", "ssim=0.8", "sim>=0.8", "ssim>=", "ssim>=high", "ssim>=0.8,", "commit>1"}) {
    expect_exit(pick("made", conditions), 2, "--pick expects conditions");
  }
  EXPECT_EQ(run("supertac-sweep --out absent").code, 2);
  expect_exit(run("supertac-sweep --out made --scale 2"), 2, "--scale: says something beside --data only");
  EXPECT_EQ(sweep("bad2", "--seeds 0.5").code, 2);
  EXPECT_EQ(sweep("bad2", "--preset huge").code, 2);
  EXPECT_FALSE(fs::exists(path("bad2/sweep.csv")));
}

}  // namespace
}  // namespace supertac
