// supertac-sweep as a process: a small grid, going on after an end, damaged tables, the choice among rows.
#include <gtest/gtest.h>

#include <array>
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
    "steps,"
    "commit";

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

// The cell of a line of the table.
std::string cell(const std::string& line, const std::string& name) {
  std::istringstream columns(kHeader), cells(line);
  std::string value;
  for (std::string column; std::getline(columns, column, ',') && std::getline(cells, value, ',');)
    if (column == name) return value;
  return "";
}

class Sweep : public OnSimulatedData {
 protected:
  // Two models: T 32 and 64, x2, eight channels, one RCAB.
  static ProcessResult sweep(const std::string& out, const std::string& epochs = "1",
                             const std::vector<std::string>& more = {}, const ProcessOptions& how = {}) {
    std::vector<std::string> all{"--out",     path(out), "--data",      path("data"), "--latent",   "2",
                                 "--scale",   "2",       "--timesteps", "32,64",      "--channels", "8",
                                 "--rcabs",   "1",       "--batch",     "8",          "--stride",   "8",
                                 "--threads", "1",       "--limit",     "50",         "--epochs",   epochs};
    all.insert(all.end(), more.begin(), more.end());
    return run_process("supertac-sweep", all, how);
  }

  static ProcessResult pick(const std::string& out, const std::string& conditions) {
    return run_process("supertac-sweep",
                       {"--out", path(out), "--pick", conditions, "--json", path(out + ".json"), "--force"});
  }

  // A table without models behind it.
  static void write_table(const std::string& out, const std::string& rows) {
    fs::create_directories(path(out));
    write_file(path(out) + "/sweep.csv", kHeader + "\n" + rows);
  }
};

TEST_F(Sweep, WritesARowAModelAndDoesNotRepeatIt) {
  const ProcessResult first = sweep("grid");
  ASSERT_EQ(first.code, 0) << first.error;
  const std::string csv = bytes("grid/sweep.csv");
  EXPECT_EQ(csv.substr(0, csv.find('\n')), kHeader);
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 3);
  for (const char* name : {"paper_t32_l2_x2_c8_r1_s0", "paper_t64_l2_x2_c8_r1_s0"}) {
    EXPECT_NE(csv.find(std::string("\n") + name + ",paper,"), std::string::npos) << csv;
    EXPECT_TRUE(fs::exists(path("grid/models/" + std::string(name) + ".safetensors")));
  }
  const std::string page = bytes("grid/chart.html");
  EXPECT_NE(page.find("Pareto front"), std::string::npos);
  EXPECT_EQ(page.find("<!--"), std::string::npos);
  const ProcessResult again = sweep("grid");
  EXPECT_EQ(again.code, 0) << again.error;
  EXPECT_EQ(again.error.find("training on"), std::string::npos) << again.error;
  EXPECT_EQ(bytes("grid/sweep.csv"), csv);

  const std::string beginning = "this sweep began with ";
  const ProcessResult longer = sweep("grid", "2"), slower = sweep("grid", "1", {"--rate", "100"});
  EXPECT_EQ(longer.code, 1);
  EXPECT_NE(longer.error.find(beginning + "epochs \"1\", now it is \"2\""), std::string::npos)
      << longer.error;
  EXPECT_EQ(slower.code, 1);
  EXPECT_NE(slower.error.find(beginning + "rate \"the preset's\", now it is \"100\""), std::string::npos)
      << slower.error;

  fs::rename(path("data"), path("before"));  // the same names, other recordings
  ASSERT_EQ(run_process("supertac-simulate", {"--out", path("data"), "--plates", "3_Bumps", "--speeds", "10",
                                              "--passes", "1", "--seed", "2"})
                .code,
            0);
  const ProcessResult other = sweep("grid");
  fs::remove_all(path("data"));
  fs::rename(path("before"), path("data"));
  EXPECT_EQ(other.code, 1);
  EXPECT_NE(other.error.find(beginning + "data "), std::string::npos) << other.error;
}

TEST_F(Sweep, HistoryJudgesModelsOnTheSameFrames) {
  const ProcessResult swept = sweep("history", "1", {"--history", "1440"});
  ASSERT_EQ(swept.code, 0) << swept.error;
  const std::string csv = bytes("history/sweep.csv");
  std::istringstream lines(csv);
  std::vector<std::string> windows;
  for (std::string line; std::getline(lines, line);) windows.push_back(cell(line, "all_windows"));
  ASSERT_EQ(windows.size(), 3U) << csv;
  EXPECT_EQ(windows[1], windows[2]);
  EXPECT_LT(std::stoi(windows[1]), 50) << "nothing was left out";

  const ProcessResult none = sweep("none", "1", {"--history", "100000"});
  EXPECT_EQ(none.code, 2);
  EXPECT_NE(none.error.find("--history 100000 leaves none of the "), std::string::npos) << none.error;
}

// Each at its own rate, so that windows of 64 samples span 0.64 s of one and 1.28 s of the other.
TEST_F(Sweep, PresetsOfOneTableAreTrainedAtTheirOwnRates) {
  const ProcessResult swept = run_process("supertac-sweep", {"--out",       path("presets"),
                                                             "--data",      path("data"),
                                                             "--preset",    "paper,tiny",
                                                             "--timesteps", "64",
                                                             "--channels",  "8",
                                                             "--rcabs",     "1",
                                                             "--scale",     "2",
                                                             "--epochs",    "1",
                                                             "--stride",    "8",
                                                             "--threads",   "1"});
  ASSERT_EQ(swept.code, 0) << swept.error;
  std::istringstream lines(bytes("presets/sweep.csv"));
  std::vector<std::string> windows;
  for (std::string line; std::getline(lines, line);) windows.push_back(cell(line, "all_windows"));
  ASSERT_EQ(windows.size(), 3U);
  EXPECT_GT(std::stoi(windows[1]), 1.8 * std::stoi(windows[2]));
}

TEST_F(Sweep, ACutLineIsDroppedAndItsModelMeasuredAgain) {
  ASSERT_EQ(sweep("cut").code, 0);
  const std::string csv = bytes("cut/sweep.csv");
  write_file(path("cut/sweep.csv"), std::string_view(csv).substr(0, csv.size() - 20));
  const ProcessResult again = sweep("cut");
  ASSERT_EQ(again.code, 0) << again.error;
  EXPECT_NE(again.error.find("the last line was cut off"), std::string::npos) << again.error;
  const std::string mended = bytes("cut/sweep.csv");
  EXPECT_EQ(std::count(mended.begin(), mended.end(), '\n'), 3);
  EXPECT_EQ(mended.substr(0, csv.rfind("paper_t64")), csv.substr(0, csv.rfind("paper_t64")));
}

TEST_F(Sweep, AStoppedModelGoesOnToTheSameBytes) {
  const std::vector<std::string> often{"--checkpoint-every", "5"};
  ASSERT_EQ(sweep("whole", "8", often).code, 0);
  const std::string model = "/models/paper_t64_l2_x2_c8_r1_s0";  // the longest is the first
  const ProcessResult stopped =
      sweep("stopped", "8", often,
            {.signal = SIGINT, .signal_when = path("stopped" + model + ".run/last.safetensors")});
  EXPECT_EQ(stopped.code, 128 + SIGINT) << stopped.error;
  EXPECT_FALSE(fs::exists(path("stopped" + model + ".safetensors")));
  const ProcessResult resumed = sweep("stopped", "8", often);
  ASSERT_EQ(resumed.code, 0) << resumed.error;
  EXPECT_NE(resumed.error.find("resumed at"), std::string::npos) << resumed.error;
  EXPECT_TRUE(bytes("whole" + model + ".safetensors") == bytes("stopped" + model + ".safetensors"));
}

// Everything but times and memory, which are never the same.
std::string without_times(const std::string& csv) {
  std::string kept;
  std::istringstream lines(csv);
  for (std::string line; std::getline(lines, line); kept += "\n") {
    std::istringstream columns(kHeader), cells(line);
    std::string value;
    for (std::string column; std::getline(columns, column, ',') && std::getline(cells, value, ',');)
      if (column != "median_us" && column != "p99_us" && column != "memory_mb" && column != "train_s")
        kept += value + ",";
  }
  return kept;
}

const std::vector<std::string> kFour{"--seeds", "0,1"};  // models

TEST_F(Sweep, ProcessesOfOneFolderShareTheTrainingsAndTakeOverFromALostOne) {
  ASSERT_EQ(sweep("one", "1", kFour).code, 0);
  const std::string expected = without_times(bytes("one/sweep.csv"));
  EXPECT_EQ(std::count(expected.begin(), expected.end(), '\n'), 5);
  const auto words = [&](const std::string& out) {
    return std::vector<std::string>{"--out",     path(out), "--data",      path("data"), "--latent",   "2",
                                    "--scale",   "2",       "--timesteps", "32,64",      "--channels", "8",
                                    "--rcabs",   "1",       "--batch",     "8",          "--stride",   "8",
                                    "--threads", "1",       "--limit",     "50",         "--epochs",   "1",
                                    "--seeds",   "0,1"};
  };
  RunningProcess first("supertac-sweep", words("two")), second("supertac-sweep", words("two"));
  const ProcessResult a = first.wait(), b = second.wait();
  EXPECT_EQ(a.code + b.code, 0) << a.error << b.error;
  EXPECT_EQ(without_times(bytes("two/sweep.csv")), expected);
  EXPECT_NE(a.error.find("of 4 paper"), std::string::npos) << "the second did it all";
  EXPECT_NE(b.error.find("of 4 paper"), std::string::npos) << "the first did it all";
  RunningProcess lost("supertac-sweep", words("left"));
  wait_for_file(path("left/models/paper_t64_l2_x2_c8_r1_s0.run/log.csv"));
  RunningProcess other("supertac-sweep", words("left"));
  wait_for_file(path("left/models/paper_t64_l2_x2_c8_r1_s1.run/log.csv"));
  lost.send(SIGKILL);
  EXPECT_EQ(lost.wait().code, 128 + SIGKILL);
  const ProcessResult left = other.wait();
  EXPECT_EQ(left.code, 0) << left.error;
  EXPECT_EQ(without_times(bytes("left/sweep.csv")), expected);
}

// A frozen process keeps its folder's lock for ever.
TEST_F(Sweep, AFrozenProcessIsGivenUp) {
  const std::vector<std::string> words{"--out",       path("frozen"),
                                       "--data",      path("data"),
                                       "--latent",    "2",
                                       "--scale",     "2",
                                       "--timesteps", "32",
                                       "--channels",  "8",
                                       "--rcabs",     "1",
                                       "--batch",     "8",
                                       "--stride",    "8",
                                       "--threads",   "1",
                                       "--epochs",    "50",
                                       "--deadline",  "2"};
  RunningProcess frozen("supertac-sweep", words);
  wait_for_file(path("frozen/models/paper_t32_l2_x2_c8_r1_s0.run/log.csv"));
  frozen.send(SIGSTOP);
  const auto begin = std::chrono::steady_clock::now();
  const ProcessResult other = run_process("supertac-sweep", words);
  EXPECT_EQ(other.code, 1);
  EXPECT_NE(other.error.find("have written nothing for 2 s; end those that are frozen"), std::string::npos)
      << other.error;
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(200));
}

// A sweep trains as supertac-train does: one model can be trained again without the others.
TEST_F(Sweep, ItsModelsAreThoseOfSupertacTrain) {
  ASSERT_EQ(sweep("whole4", "1", kFour).code, 0);
  const ProcessResult trained = run_process(
      "supertac-train", {"--data", path("data"), "--out", path("same.safetensors"), "--like",
                         path("whole4/models/paper_t64_l2_x2_c8_r1_s1.safetensors"), "--threads", "1"});
  ASSERT_EQ(trained.code, 0) << trained.error;
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
  const ProcessResult none = pick("made", "ssim>=0.99");
  EXPECT_EQ(none.code, 1);
  EXPECT_NE(none.error.find("no configuration meets ssim>=0.99"), std::string::npos) << none.error;
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
    const ProcessResult result = pick("bad", "ssim>=0.1");
    EXPECT_EQ(result.code, 1);
    EXPECT_NE(result.error.find(bad.message), std::string::npos) << result.error;
    EXPECT_EQ(std::count(result.error.begin(), result.error.end(), '\n'), 1) << result.error;
  }
  write_file(path("bad/sweep.csv"), "model,ssim\n");
  EXPECT_NE(pick("bad", "ssim>=0.1").error.find("line 1: expected the columns"), std::string::npos);

  for (const char* conditions :
       {"ssim", "ssim=0.8", "sim>=0.8", "ssim>=", "ssim>=high", "ssim>=0.8,", "commit>1"}) {
    const ProcessResult result = pick("made", conditions);
    EXPECT_EQ(result.code, 2) << conditions;
    EXPECT_NE(result.error.find("--pick expects conditions"), std::string::npos) << result.error;
  }
  EXPECT_EQ(run_process("supertac-sweep", {"--out", path("absent")}).code, 2);
  const ProcessResult reading = run_process("supertac-sweep", {"--out", path("made"), "--scale", "2"});
  EXPECT_EQ(reading.code, 2);
  EXPECT_NE(reading.error.find("--scale: says something beside --data only"), std::string::npos)
      << reading.error;
  EXPECT_EQ(sweep("bad2", "1", {"--seeds", "0.5"}).code, 2);
  EXPECT_EQ(sweep("bad2", "1", {"--preset", "huge"}).code, 2);
  EXPECT_FALSE(fs::exists(path("bad2/sweep.csv")));
}

}  // namespace
}  // namespace supertac
