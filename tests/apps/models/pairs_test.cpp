// supertac-train and supertac-evaluate on pairs of images: of another sensor, and of recordings.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "data/windows/split.h"
#include "io/files/file.h"
#include "io/files/safetensors.h"
#include "io/numbers/random.h"
#include "tests/apps/common/process.h"

namespace supertac {
namespace {

constexpr std::uint64_t kPlenty = 1 << 26;

/// A ridge at a random place and angle under an array of 4 x 6 taxels; five groups of twelve.
std::string write_pairs(const TemporaryFolder& folder, bool grouped = true) {
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
      input.push_back(2.4F - 0.3F * ridge(static_cast<double>(k / kColumns) + 0.5,
                                          static_cast<double>(k % kColumns) + 0.5, 1));
    for (std::uint64_t p = 0; p < kRows * kColumns * kScale * kScale; ++p)
      target.push_back(ridge((static_cast<double>(p / (kColumns * kScale)) + 0.5) / kScale,
                             (static_cast<double>(p % (kColumns * kScale)) + 0.5) / kScale, 0.5));
    group.push_back(static_cast<std::int64_t>(100 + n / 12));
  }
  std::vector<TensorToWrite> tensors = {
      {"input", "F32", {kCount, 1, kRows, kColumns}, std::as_bytes(std::span(input))},
      {"target", "F32", {kCount, 1, kRows * kScale, kColumns * kScale}, std::as_bytes(std::span(target))}};
  if (grouped) tensors.push_back({"group", "I64", {kCount}, std::as_bytes(std::span(group))});
  const std::string path = folder / (grouped ? "pairs.safetensors" : "loose.safetensors");
  write_safetensors(path, {}, tensors);
  return path;
}

/// Targets of a sensor with 6 x 10 taxels, below it one of 3 x 5.
std::string write_small_pairs(const TemporaryFolder& folder) {
  constexpr std::uint64_t kCount = 24;
  std::vector<float> input, target;
  for (std::uint64_t n = 0; n < kCount; ++n) {
    const auto at = [&](std::uint64_t i, double step) {
      return static_cast<float>(0.5 + 0.4 * std::sin(static_cast<double>(n) + step * static_cast<double>(i)));
    };
    for (std::uint64_t i = 0; i < 15; ++i) input.push_back(at(i, 0.4));
    for (std::uint64_t i = 0; i < 60; ++i) target.push_back(at(i, 0.2));
  }
  const std::string path = folder / "small.safetensors";
  write_safetensors(path, {},
                    {{"input", "F32", {kCount, 1, 3, 5}, std::as_bytes(std::span(input))},
                     {"target", "F32", {kCount, 1, 6, 10}, std::as_bytes(std::span(target))}});
  return path;
}

std::vector<std::string> training(const TemporaryFolder& folder, const std::string& out,
                                  const std::vector<std::string>& more = {}) {
  std::vector<std::string> all = {"--pairs",  folder / "pairs.safetensors",
                                  "--out",    folder / out,
                                  "--epochs", "2",
                                  "--batch",  "16",
                                  "--seed",   "3"};
  all.insert(all.end(), more.begin(), more.end());
  return all;
}

TEST(Pairs, TrainEvaluateAndReportEveryGroup) {
  const TemporaryFolder folder;
  const std::string pairs = write_pairs(folder), model = folder / "m.safetensors";
  const auto trained = run_process("supertac-train", {"--pairs", pairs, "--out", model, "--epochs", "25",
                                                      "--batch", "16", "--json", folder / "train.json"});
  ASSERT_EQ(trained.code, 0) << trained.error;
  const auto card = nlohmann::json::parse(read_text_file(folder / "train.json", kPlenty));
  EXPECT_EQ(card["split"], "group");
  EXPECT_EQ(card["train_pairs"], 48);
  EXPECT_EQ(card["model"]["width"], 6);
  const auto evaluated =
      run_process("supertac-evaluate", {"--model", model, "--pairs", pairs, "--json", folder / "scores.json",
                                        "--outputs", folder / "outputs.safetensors"});
  ASSERT_EQ(evaluated.code, 0) << evaluated.error;
  const auto scores = nlohmann::json::parse(read_text_file(folder / "scores.json", kPlenty));
  EXPECT_EQ(scores["all"]["pairs"], 12);
  ASSERT_EQ(scores["groups"].size(), 1u) << "a fifth of five groups";
  EXPECT_EQ(scores["groups"].front(), scores["all"]);
  EXPECT_GT(scores["all"]["network"]["psnr_mean_db"], scores["all"]["bicubic"]["psnr_mean_db"]);
  EXPECT_GT(scores["all"]["bicubic"]["psnr_mean_db"], scores["all"]["mean_image"]["psnr_mean_db"]);
  const auto outputs = SafetensorsFile::read(folder / "outputs.safetensors");
  EXPECT_EQ(outputs.tensors().at("output").shape, (std::vector<std::uint64_t>{12, 1, 16, 24}));
  const auto whole =
      run_process("supertac-evaluate", {"--model", model, "--pairs", pairs, "--split", "none"});
  EXPECT_NE(whole.out.find("group 104, 12 pairs"), std::string::npos) << whole.out;
}

TEST(Pairs, TargetsBelowSevenPixelsAreJudgedByASmallerWindowAndItIsSaid) {
  const TemporaryFolder folder;
  const std::string pairs = write_small_pairs(folder), model = folder / "m.safetensors",
                    json = folder / "scores.json";
  const auto trained =
      run_process("supertac-train", {"--pairs", pairs, "--out", model, "--epochs", "1", "--batch", "8"});
  ASSERT_EQ(trained.code, 0) << trained.error;
  const auto judged = run_process("supertac-evaluate", {"--pairs", pairs, "--model", model, "--json", json});
  EXPECT_EQ(judged.code, 0) << judged.error;
  EXPECT_NE(judged.error.find("SSIM's window is 5 pixels wide instead of 7"), std::string::npos)
      << judged.error;
  EXPECT_TRUE(
      nlohmann::json::parse(read_text_file(json, kPlenty)).at("all").at("network").at("ssim").is_number());
}

TEST(Pairs, SameBytesForAnyThreadsAndAfterAPause) {
  const TemporaryFolder folder;
  write_pairs(folder);
  for (const char* threads : {"1", "2"}) {
    const auto trained = run_process(
        "supertac-train", training(folder, std::string(threads) + ".safetensors", {"--threads", threads}));
    ASSERT_EQ(trained.code, 0) << trained.error;
  }
  EXPECT_EQ(read_file(folder / "1.safetensors", kPlenty), read_file(folder / "2.safetensors", kPlenty));
  const auto finished = run_process(
      "supertac-train", training(folder, "3.safetensors", {"--resume", folder / "1.run/last.safetensors"}));
  ASSERT_EQ(finished.code, 0) << finished.error;
  EXPECT_EQ(read_file(folder / "1.safetensors", kPlenty), read_file(folder / "3.safetensors", kPlenty));
  const auto other = run_process(
      "supertac-train",
      training(folder, "4.safetensors", {"--resume", folder / "1.run/last.safetensors", "--lambda", "0.5"}));
  EXPECT_EQ(other.code, 1);
  EXPECT_NE(other.error.find("cannot resume: its training"), std::string::npos) << other.error;
  EXPECT_FALSE(std::filesystem::exists(folder / "4.run"));
}

TEST(Pairs, RefusesWhatIsAboutRecordingsAndTheOtherModel) {
  const TemporaryFolder folder;
  const std::string pairs = write_pairs(folder), model = folder / "m.safetensors";
  const auto expect = [](const ProcessResult& result, int code, const std::string& text) {
    EXPECT_EQ(result.code, code) << result.error;
    EXPECT_NE(result.error.find(text), std::string::npos) << result.error;
  };
  for (const auto& [option, value] :
       std::vector<std::pair<std::string, std::string>>{{"--also", "d"},
                                                        {"--preset", "tiny"},
                                                        {"--timesteps", "64"},
                                                        {"--latent", "3"},
                                                        {"--scale", "2"},
                                                        {"--rate", "100"},
                                                        {"--range", "2,1"},
                                                        {"--scaling", "fixed"},
                                                        {"--grouping", "vertical"},
                                                        {"--stride", "2"},
                                                        {"--augment", "none"},
                                                        {"--beta", "0"},
                                                        {"--plates", "p"},
                                                        {"--autoencoder", "plain"}}) {
    expect(run_process("supertac-train", training(folder, "m.safetensors", {option, value})), 2,
           option + ": says something beside --data only, which is not given; leave it out");
  }
  expect(run_process("supertac-train", training(folder, "m.safetensors", {"--data", "d"})), 2,
         "expected --data DIR or --pairs FILE, found 2");
  expect(run_process("supertac-train", training(folder, "m.safetensors", {"--split", "trial"})), 2,
         "expected one of group, pair, none");
  expect(run_process("supertac-train", {"--out", model}), 2,
         "expected --data DIR or --pairs FILE, found none");
  const auto loose = write_pairs(folder, false);
  expect(run_process("supertac-train", {"--pairs", loose, "--out", model, "--split", "group"}), 1,
         "needs a tensor 'group'");
  EXPECT_FALSE(std::filesystem::exists(model));
  const auto trained = run_process("supertac-train", {"--pairs", loose, "--out", model, "--epochs", "1"});
  ASSERT_EQ(trained.code, 0) << trained.error;
  EXPECT_NE(trained.error.find("split pair leaks"), std::string::npos) << trained.error;
  expect(run_process("supertac-evaluate", {"--model", model, "--data", folder.path()}), 1,
         "found a frame model");
  expect(run_process("supertac-evaluate", {"--model", model}), 2,
         "expected --data DIR or --pairs FILE, found none");
  for (const char* option : {"--plates", "--pictures", "--write-pairs"})
    expect(run_process("supertac-evaluate", {"--model", model, "--pairs", pairs, option, folder / "p"}), 2,
           std::string(option) + ": says something beside --data only");
}

class PairsOfRecordings : public testing::Test {
 protected:
  // A model whose windows are far from the defaults in every respect.
  PairsOfRecordings() {
    const auto made = run_process("supertac-simulate", {"--out", folder_ / "data", "--plates", "3_Bumps",
                                                        "--speeds", "10", "--passes", "2"});
    EXPECT_EQ(made.code, 0) << made.error;
    const auto trained =
        run_process("supertac-train", {"--data",  folder_ / "data", "--out",  model_,    "--timesteps",
                                       "32",      "--scale",        "2",      "--rate",  "50",
                                       "--split", "pass",           "--seed", "1",       "--epochs",
                                       "1",       "--latent",       "2",      "--range", "2.5,0.4"});
    EXPECT_EQ(trained.code, 0) << trained.error;
  }
  ProcessResult make_pairs(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> all = {"--model",        model_,          "--data",
                                    folder_ / "data", "--write-pairs", folder_ / "pairs"};
    all.insert(all.end(), more.begin(), more.end());
    return run_process("supertac-evaluate", all);
  }

  const TemporaryFolder folder_;
  const std::string model_ = folder_ / "model.safetensors";
};

/// Every pair is its window's last frame as a network sees it, its truth and its pass.
void expect_pairs_of(const std::string& path, const WindowSet& windows,
                     const std::vector<std::uint32_t>& indices) {
  const PairSet pairs = PairSet::read(path);
  ASSERT_EQ(pairs.size(), indices.size());
  ASSERT_TRUE(pairs.grouped());
  const std::size_t pixels = windows.image().pixels();
  std::vector<float> input(16), target(pixels), truth(pixels), window(windows.input_size());
  for (std::size_t n = 0; n < indices.size(); ++n) {
    pairs.input(n, input);
    pairs.target(n, target);
    windows.truth(indices[n], truth);
    windows.window(indices[n], window);
    ASSERT_TRUE(std::equal(window.end() - 16, window.end(), input.begin())) << path << ", pair " << n;
    ASSERT_EQ(target, truth) << path << ", pair " << n;
    ASSERT_EQ(pairs.group(n), windows.group(indices[n])) << path << ", pair " << n;
  }
}

TEST_F(PairsOfRecordings, AreTheWindowsOfTheModelAndItsSplit) {
  const auto made = make_pairs();
  ASSERT_EQ(made.code, 0) << made.error;
  const WindowSet windows =
      WindowSet::load(folder_ / "data", {},
                      {.timesteps = 32,
                       .scale = 2,
                       .rate_hz = 50,
                       .scaling = {.rest_volts = 2.5, .span_volts = 0.4, .per_window = true}});
  const Split split = make_split(windows, SplitKind::pass, 1);
  expect_pairs_of(folder_ / "pairs/train.safetensors", windows, split.train);
  expect_pairs_of(folder_ / "pairs/test.safetensors", windows, split.test);
  EXPECT_NE(made.out.find(std::to_string(split.train.size()) + " pairs to train on, " +
                          std::to_string(split.test.size()) + " to test"),
            std::string::npos)
      << made.out;

  const std::string model = folder_ / "m.safetensors";
  const auto trained = run_process("supertac-train", {"--pairs", folder_ / "pairs/train.safetensors", "--out",
                                                      model, "--epochs", "1", "--split", "none"});
  ASSERT_EQ(trained.code, 0) << trained.error;
  const auto tested =
      run_process("supertac-evaluate", {"--model", model, "--pairs", folder_ / "pairs/test.safetensors"});
  EXPECT_EQ(tested.code, 0) << tested.error;
  EXPECT_NE(tested.out.find(std::to_string(split.test.size()) + " pairs"), std::string::npos) << tested.out;

  const std::string path = folder_ / "pairs/test.safetensors";
  auto bytes = read_file(path, 1 << 26);
  bytes[bytes.size() - 100] ^= std::byte{1};
  write_file(path, bytes);
  EXPECT_THROW((void)PairSet::read(path), FileError) << "a flipped bit was not noticed";
}

TEST_F(PairsOfRecordings, KeepExistingFilesAndLeaveNothingOnError) {
  const auto expect = [](const ProcessResult& result, int code, const std::string& text) {
    EXPECT_EQ(result.code, code) << result.error;
    EXPECT_NE(result.error.find(text), std::string::npos) << result.error;
    EXPECT_EQ(std::count(result.error.begin(), result.error.end(), '\n'), 1) << result.error;
  };
  expect(make_pairs({"--plates", "6_Ridges"}), 1, "6_Ridges");
  expect(make_pairs({"--split", "texture"}), 1, "plate");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "pairs"));
  ASSERT_EQ(make_pairs({"--limit", "50"}).code, 0);
  const auto before = read_file(folder_ / "pairs/test.safetensors", kPlenty);
  expect(make_pairs(), 1, "--force");
  EXPECT_EQ(read_file(folder_ / "pairs/test.safetensors", kPlenty), before);
  EXPECT_EQ(make_pairs({"--limit", "20", "--force"}).code, 0);
  EXPECT_LT(read_file(folder_ / "pairs/test.safetensors", kPlenty).size(), before.size());
}

}  // namespace
}  // namespace supertac
