// Single frames with measured truths, from a file of pairs: imported, trained on, scored, streamed, told
// apart.
#include <nlohmann/json.hpp>
#include <regex>

#include "data/recordings/recording.h"
#include "io/numbers/random.h"
#include "tests/apps/common/expect.h"
#include "tests/support/tensor_file.h"

namespace supertac::frames_test {

/// A ridge at a random place and angle under an array of 4 x 6 taxels; five groups of twelve.
class Frames : public ProgramTest {
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
    succeed("supertac-import pairs.safetensors --out data");
  }
  ProcessResult train(const std::string& out, const std::string& more = "") const {
    return succeed("supertac-train --data data --out " + out +
                   " --preset frame --split group --epochs 2 --batch 16 " + more);
  }
};

TEST_F(Frames, TrainScoreDrawAndReport) {
  train("m.safetensors", "--epochs 25 --json train.json");
  EXPECT_EQ(json("train.json")["split"], "group");
  EXPECT_EQ(json("train.json")["train_windows"], 36) << "one group chooses the epoch";
  EXPECT_EQ(json("train.json")["model"]["timesteps"], 1);
  const ProcessResult scored = succeed(
      "supertac-evaluate --model m.safetensors --data data --json scores.json --outputs "
      "outputs.safetensors --report report.html --pictures pictures");
  const auto scores = json("scores.json");
  EXPECT_EQ(scores["all"]["windows"], 12) << "a fifth of five groups";
  EXPECT_GT(scores["all"]["psnr_mean_db"], scores["baselines"]["bicubic"]["all"]["psnr_mean_db"]);
  EXPECT_GT(scores["baselines"]["bicubic"]["all"]["psnr_mean_db"],
            scores["baselines"]["mean_image"]["all"]["psnr_mean_db"]);
  EXPECT_TRUE(scores["by_distance"].empty()) << "nobody knows where it was";
  EXPECT_GE(scores["trust"]["coverage"], 0.87) << "training found nine in ten of each level on these groups";
  EXPECT_EQ(scores["trust"]["interval"], scores["trust"]["interval_found"]);
  EXPECT_TRUE(contains(scored.error, "found on these groups"));
  const auto outputs = SafetensorsFile::read(path("outputs.safetensors"));
  EXPECT_EQ(outputs.tensors().at("output").shape, (std::vector<std::uint64_t>{12, 16, 24}));
  EXPECT_FALSE(contains(bytes("report.html"), "nan"));
  succeed("supertac-evaluate --model m.safetensors --data data --precision int8");
}

TEST_F(Frames, SameBytesForAnyThreadsAndAfterAPause) {
  for (const std::string threads : {"1", "2"}) train(threads + ".safetensors", "--threads " + threads);
  EXPECT_EQ(bytes("1.safetensors"), bytes("2.safetensors"));
  train("3.safetensors", "--resume 1.run/last.safetensors");
  EXPECT_EQ(bytes("1.safetensors"), bytes("3.safetensors"));
  succeed("supertac-train --data data --recipe-of 1.safetensors --out 4.safetensors");
  EXPECT_EQ(json("1.run/settings.json")["content"], json("4.run/settings.json")["content"]);
}

// Five epochs that are no better end a training, whose model is the network before them.
TEST_F(Frames, ATrainingThatKeepsItsBestEpochIsRepeated) {
  const std::string kept = train("m.safetensors", "--epochs 90 --learning-rate 0.03 --ledger 4").error;
  EXPECT_TRUE(std::regex_search(kept, std::regex("the network of epoch [0-9]+ of [1-8]?[0-9] is kept")))
      << kept;
  const std::string audit = "supertac-check training m.safetensors --data data --segments 1000";
  succeed(audit);
  const std::string other_end = path("m.run/last.safetensors"),
                    kept_state = path("m.run/states/8.safetensors");
  TensorFile state(SafetensorsFile::read(kept_state));
  const auto honest = state;
  state.metadata["best_score"] = "0.99";
  state.write(kept_state);
  EXPECT_TRUE(contains(run(audit).out, "the best epoch"));
  honest.write(kept_state);
  std::filesystem::copy(other_end, path("m.safetensors"), std::filesystem::copy_options::overwrite_existing);
  const ProcessResult other = run(audit);
  EXPECT_EQ(other.code, 1);
  EXPECT_TRUE(contains(other.out, "the model's file")) << other.out;
}

// Other groups, another factor; a stated one is kept.
TEST_F(Frames, TheFactorOfTheIntervalsIsFoundOrStated) {
  const auto factor = [&](const std::string& name) {
    return value_or(SafetensorsFile::read(path(name)).metadata(), "interval_factor", "none");
  };
  train("a.safetensors");
  succeed("supertac-train --data data --recipe-of a.safetensors --seed 3 --out b.safetensors");
  train("c.safetensors", "--interval-factor 1.7");
  train("d.safetensors", "--split none");
  EXPECT_GT(std::stod(factor("a.safetensors")), 0);
  EXPECT_NE(factor("b.safetensors"), factor("a.safetensors"));
  EXPECT_EQ(factor("c.safetensors"), "1.7");
  EXPECT_EQ(factor("d.safetensors"), "none");
}

// What windows have single frames have too.
TEST_F(Frames, AreStreamedToldApartAndExported) {
  train("m.safetensors", "--augment standard");
  const std::string recording = "data/099_t0_p1_v0.safetensors";
  succeed("supertac-stream --recording " + recording +
          " --model m.safetensors --out live.safetensors --quiet");
  succeed("supertac-evaluate --model m.safetensors --data data --split none --outputs all.safetensors");
  const std::vector<float> live = SafetensorsFile::read(path("live.safetensors")).f32("pictures"),
                           all = SafetensorsFile::read(path("all.safetensors")).f32("output");
  ASSERT_EQ(live.size(), 12u * 16 * 24);
  // Of five recordings with twelve frames each it is the fourth by name: 096 to 100.
  EXPECT_TRUE(std::equal(live.begin(), live.end(), all.begin() + 3 * 12 * 16 * 24));
  succeed("supertac-export m.safetensors --onnx m.onnx");
  succeed("supertac-classify --data data --model m.safetensors --seeds 1 --epochs 1");
}

TEST_F(Frames, OfOnePlateAreLeftOutByName) {
  train("m.safetensors", "--split texture --leave-out 098 --json train.json");
  EXPECT_EQ(json("train.json")["test_windows"], 12);
}

TEST_F(Frames, AreRefusedWhereTheyDoNotFit) {
  const std::string train = "supertac-train --data data --out m.safetensors ";
  expect_exit(run(train + "--timesteps 1"), 2, "give --scaling fixed, or --preset frame");
  expect_exit(run(train + "--preset frame --split trial"), 1, "expects a trial, got none; use split group");
  expect_exit(run(train + "--preset frame --split group --scale 2"), 1,
              "has a truth of 16x24 pixels, expected 8x12");
  expect_exit(run(train + "--pairs p"), 2, "pairs");
  expect_exit(run("supertac-import pairs.safetensors --out o --speed 3"), 2, "as it is, found with --speed");
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
  succeed("supertac-import small.safetensors --out data");
  const ProcessResult trained = train("m.safetensors", "--split window --scale 2");
  EXPECT_TRUE(contains(trained.error, "split window leaks when frames resemble each other"));
  const ProcessResult judged = succeed("supertac-evaluate --model m.safetensors --data data --json s.json");
  EXPECT_TRUE(contains(judged.error, "SSIM's window is 5 pixels wide instead of 7"));
  EXPECT_TRUE(json("s.json")["all"]["ssim"].is_number());
}

}  // namespace supertac::frames_test
