// Single frames with measured truths, from a file of pairs: imported, trained on, scored, streamed, told
// apart.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "data/recordings/recording.h"
#include "io/files/file.h"
#include "io/files/safetensors.h"
#include "io/numbers/random.h"
#include "tests/apps/common/process.h"

namespace supertac {
namespace {

constexpr std::uint64_t kPlenty = 1 << 26;

/// A ridge at a random place and angle under an array of 4 x 6 taxels; five groups of twelve.
class Frames : public testing::Test {
 protected:
  Frames() {
    constexpr std::uint64_t kCount = 60, kRows = 4, kColumns = 6, kScale = 4;
    std::vector<float> input, target;
    std::vector<std::int64_t> group;
    const RandomStream random(9, 0);
    for (std::uint64_t n = 0; n < kCount; ++n) {
      const double slope = 2 * random.uniform(2 * n) - 1, offset = 4 * random.uniform(2 * n + 1);
      const auto ridge = [&](double y, double x, double width) {
        return static_cast<float>(std::exp(-std::pow((y - offset - slope * (x - 3)) / width, 2)));
      };
      for (std::uint64_t k = 0; k < kRows * kColumns; ++k)
        input.push_back(200 + 300 * ridge(static_cast<double>(k / kColumns) + 0.5,
                                          static_cast<double>(k % kColumns) + 0.5, 1));
      for (std::uint64_t p = 0; p < kRows * kColumns * kScale * kScale; ++p)
        target.push_back(ridge((static_cast<double>(p / (kColumns * kScale)) + 0.5) / kScale,
                               (static_cast<double>(p % (kColumns * kScale)) + 0.5) / kScale, 0.5));
      group.push_back(static_cast<std::int64_t>(96 + n / 12));
    }
    write_safetensors(
        path("pairs.safetensors"), {},
        {{"input", "F32", {kCount, 1, kRows, kColumns}, std::as_bytes(std::span(input))},
         {"target", "F32", {kCount, 1, kRows * kScale, kColumns * kScale}, std::as_bytes(std::span(target))},
         {"group", "I64", {kCount}, std::as_bytes(std::span(group))}});
    run("supertac-import", {path("pairs.safetensors"), "--out", path("data")});
  }
  std::string path(const std::string& name) const { return folder_ / name; }
  ProcessResult run(const char* program, const std::vector<std::string>& arguments) const {
    ProcessResult result = run_process(program, arguments);
    EXPECT_EQ(result.code, 0) << program << ": " << result.error;
    return result;
  }
  ProcessResult train(const std::string& out, const std::vector<std::string>& more = {}) const {
    std::vector<std::string> all = {"--data",  path("data"), "--out",    path(out), "--preset", "frame",
                                    "--split", "group",      "--epochs", "2",       "--batch",  "16"};
    all.insert(all.end(), more.begin(), more.end());
    return run("supertac-train", all);
  }
  nlohmann::json json(const std::string& name) const {
    return nlohmann::json::parse(read_text_file(path(name), kPlenty));
  }
  void expect_refused(const char* program, const std::vector<std::string>& arguments, int code,
                      const std::string& text) const {
    const ProcessResult result = run_process(program, arguments);
    EXPECT_EQ(result.code, code) << result.error;
    EXPECT_NE(result.error.find(text), std::string::npos) << result.error;
  }

 private:
  const TemporaryFolder folder_;
};

TEST_F(Frames, TrainScoreDrawAndReport) {
  train("m.safetensors", {"--epochs", "25", "--json", path("train.json")});
  EXPECT_EQ(json("train.json")["split"], "group");
  EXPECT_EQ(json("train.json")["train_windows"], 48);
  EXPECT_EQ(json("train.json")["model"]["timesteps"], 1);
  const ProcessResult scored =
      run("supertac-evaluate", {"--model", path("m.safetensors"), "--data", path("data"), "--json",
                                path("scores.json"), "--outputs", path("outputs.safetensors"), "--report",
                                path("report.html"), "--pictures", path("pictures")});
  const nlohmann::json scores = json("scores.json");
  EXPECT_EQ(scores["all"]["windows"], 12) << "a fifth of five groups";
  EXPECT_GT(scores["all"]["psnr_mean_db"], scores["baselines"]["bicubic"]["all"]["psnr_mean_db"]);
  EXPECT_GT(scores["baselines"]["bicubic"]["all"]["psnr_mean_db"],
            scores["baselines"]["mean_image"]["all"]["psnr_mean_db"]);
  EXPECT_TRUE(scores["felt"].empty()) << "nobody knows where it was";
  EXPECT_GE(scores["trust"]["coverage"], 0.9) << "training found the factor on these groups";
  EXPECT_EQ(scores["trust"]["factor"], scores["trust"]["factor_found"]);
  EXPECT_NE(scored.error.find("found on these groups"), std::string::npos) << scored.error;
  const auto outputs = SafetensorsFile::read(path("outputs.safetensors"));
  EXPECT_EQ(outputs.tensors().at("output").shape, (std::vector<std::uint64_t>{12, 16, 24}));
  EXPECT_EQ(read_text_file(path("report.html"), kPlenty).find("nan"), std::string::npos);
  run("supertac-evaluate", {"--model", path("m.safetensors"), "--data", path("data"), "--precision", "int8"});
}

TEST_F(Frames, SameBytesForAnyThreadsAndAfterAPause) {
  for (const char* threads : {"1", "2"}) train(std::string(threads) + ".safetensors", {"--threads", threads});
  const auto bytes = [&](const char* name) { return read_file(path(name), kPlenty); };
  EXPECT_EQ(bytes("1.safetensors"), bytes("2.safetensors"));
  train("3.safetensors", {"--resume", path("1.run/last.safetensors")});
  EXPECT_EQ(bytes("1.safetensors"), bytes("3.safetensors"));
  run("supertac-train",
      {"--data", path("data"), "--like", path("1.safetensors"), "--out", path("4.safetensors")});
  EXPECT_EQ(json("1.run/settings.json")["content"], json("4.run/settings.json")["content"]);
}

// Other groups, another factor; a stated one is kept.
TEST_F(Frames, TheFactorOfTheIntervalsIsFoundOrStated) {
  const auto factor = [&](const std::string& name) {
    const SafetensorsFile file = SafetensorsFile::read(path(name));
    return file.metadata().contains("interval_factor") ? file.metadata().at("interval_factor") : "none";
  };
  train("a.safetensors");
  run("supertac-train", {"--data", path("data"), "--like", path("a.safetensors"), "--seed", "3", "--out",
                         path("b.safetensors")});
  train("c.safetensors", {"--interval-factor", "1.7"});
  train("d.safetensors", {"--split", "none"});
  EXPECT_GT(std::stod(factor("a.safetensors")), 0);
  EXPECT_NE(factor("b.safetensors"), factor("a.safetensors"));
  EXPECT_EQ(factor("c.safetensors"), "1.7");
  EXPECT_EQ(factor("d.safetensors"), "none");
}

// What windows have single frames have too.
TEST_F(Frames, AreStreamedToldApartExplainedAndExported) {
  train("m.safetensors", {"--augment", "standard"});
  const std::string model = path("m.safetensors"), recording = path("data/099_t0_p1_v0.safetensors");
  run("supertac-stream",
      {"--recording", recording, "--model", model, "--out", path("live.safetensors"), "--quiet"});
  run("supertac-evaluate",
      {"--model", model, "--data", path("data"), "--split", "none", "--outputs", path("all.safetensors")});
  const std::vector<float> live = SafetensorsFile::read(path("live.safetensors")).f32("pictures"),
                           all = SafetensorsFile::read(path("all.safetensors")).f32("output");
  ASSERT_EQ(live.size(), 12u * 16 * 24);
  // Of five recordings with twelve frames each it is the fourth by name: 096 to 100.
  EXPECT_TRUE(std::equal(live.begin(), live.end(), all.begin() + 3 * 12 * 16 * 24));
  run("supertac-explain",
      {model, "--recording", recording, "--at", "6", "--out", path("explained.safetensors")});
  run("supertac-export", {model, "--onnx", path("m.onnx")});
  run("supertac-classify", {"--data", path("data"), "--model", model, "--seeds", "1", "--epochs", "1"});
}

TEST_F(Frames, OfOnePlateAreLeftOutByName) {
  train("m.safetensors", {"--split", "texture", "--leave-out", "098", "--json", path("train.json")});
  EXPECT_EQ(json("train.json")["test_windows"], 12);
}

TEST_F(Frames, AreRefusedWhereTheyDoNotFit) {
  const std::vector<std::string> base = {"--data", path("data"), "--out", path("m.safetensors")};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.begin(), base.begin(), base.end());
    return more;
  };
  expect_refused("supertac-train", with({"--timesteps", "1"}), 2, "give --scaling fixed, or --preset frame");
  expect_refused("supertac-train", with({"--preset", "frame", "--split", "trial"}), 1,
                 "has no trial; use split group");
  expect_refused("supertac-train", with({"--preset", "frame", "--split", "group", "--scale", "2"}), 1,
                 "has a truth of 16x24 pixels, expected 8x12");
  expect_refused("supertac-train", with({"--pairs", "p"}), 2, "pairs");
  expect_refused("supertac-import", {path("pairs.safetensors"), "--out", path("o"), "--speed", "3"}, 2,
                 "as it is, found with --speed");
}

TEST_F(Frames, PicturesBelowSevenPixelsAreJudgedByASmallerWindowAndItIsSaid) {
  std::filesystem::remove_all(path("data"));
  std::vector<float> input, target;
  for (int n = 0; n < 24; ++n) {
    for (int i = 0; i < 15; ++i) input.push_back(static_cast<float>(0.5 + 0.4 * std::sin(n + 0.4 * i)));
    for (int i = 0; i < 60; ++i) target.push_back(static_cast<float>(0.5 + 0.4 * std::sin(n + 0.2 * i)));
  }
  write_safetensors(path("small.safetensors"), {},
                    {{"input", "F32", {24, 1, 3, 5}, std::as_bytes(std::span(input))},
                     {"target", "F32", {24, 1, 6, 10}, std::as_bytes(std::span(target))}});
  run("supertac-import", {path("small.safetensors"), "--out", path("data")});
  const ProcessResult trained = train("m.safetensors", {"--split", "window", "--scale", "2"});
  EXPECT_NE(trained.error.find("split window leaks when frames resemble each other"), std::string::npos)
      << trained.error;
  const ProcessResult judged = run("supertac-evaluate", {"--model", path("m.safetensors"), "--data",
                                                         path("data"), "--json", path("s.json")});
  EXPECT_NE(judged.error.find("SSIM's window is 5 pixels wide instead of 7"), std::string::npos)
      << judged.error;
  EXPECT_TRUE(json("s.json")["all"]["ssim"].is_number());
}

}  // namespace
}  // namespace supertac
