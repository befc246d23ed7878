// supertac-evaluate and supertac-stream with several models: averaged, recalled or felt, or refused.
#include <gtest/gtest.h>

#include <filesystem>

#include "io/files/json.h"
#include "io/files/safetensors.h"
#include "tests/apps/trained.h"

namespace supertac {
namespace {

namespace fs = std::filesystem;

using SeveralModels = Training;

TEST_F(SeveralModels, AreAveragedUnlessTheySawEachOthersTest) {
  const std::string one = path("one.safetensors"), two = path("two.safetensors");
  ASSERT_EQ(train("one.safetensors", {"--seed", "1", "--split", "pass"}).code, 0);
  ASSERT_EQ(train("two.safetensors", {"--seed", "2", "--split", "pass"}).code, 0);
  const ProcessResult leak =
      run_process("supertac-evaluate", {"--model", one + "," + two, "--data", path("data")});
  EXPECT_EQ(leak.code, 1);
  EXPECT_NE(leak.error.find("drawn by seed 1, of another by seed 2"), std::string::npos) << leak.error;
  const std::string all = path("all.safetensors");
  ASSERT_EQ(train("all.safetensors", {"--split", "none"}).code, 0);
  const ProcessResult mixed =
      run_process("supertac-evaluate", {"--model", one + "," + all, "--data", path("data")});
  EXPECT_EQ(mixed.code, 1);
  EXPECT_NE(mixed.error.find("split pass, another with none"), std::string::npos) << mixed.error;
  const ProcessResult every =
      run_process("supertac-evaluate",
                  {"--model", one + "," + all, "--data", path("data"), "--split", "none", "--limit", "20"});
  EXPECT_EQ(every.code, 0) << every.error;
  const ProcessResult seen =
      run_process("supertac-evaluate", {"--model", all, "--data", path("data"), "--limit", "20"});
  EXPECT_NE(seen.error.find("it has seen every one of them"), std::string::npos) << seen.error;

  const auto ssim = [&](const std::string& models) {
    const ProcessResult result =
        run_process("supertac-evaluate", {"--model", models, "--data", path("data"), "--split", "trial",
                                          "--limit", "60", "--json", path("average.json"), "--force"});
    EXPECT_EQ(result.code, 0) << result.error;
    return parse_json_limited(bytes("average.json"))["all"]["ssim"].get<double>();
  };
  const double a = ssim(one), b = ssim(two), both = ssim(one + "," + two);
  EXPECT_NE(both, a);
  EXPECT_NE(both, b);
}

// Live and scored: the same choice, said in both.
TEST_F(SeveralModels, ANetworkOfRandomPlatesBesideAnotherFeelsWhatThatDoesNotRecall) {
  ASSERT_EQ(train("recalls.safetensors", {}).code, 0);
  ASSERT_EQ(train("feels.safetensors", {"--random-plates", "3", "--epochs", "1"}).code, 0);
  const std::string both = path("recalls.safetensors") + "," + path("feels.safetensors");
  const ProcessResult scored = run_process(
      "supertac-evaluate", {"--model", both, "--data", path("data"), "--json", path("both.json")});
  ASSERT_EQ(scored.code, 0) << scored.error;
  EXPECT_NE(scored.out.find("of the pictures are felt and not recalled"), std::string::npos) << scored.out;
  const auto trust = parse_json_limited(bytes("both.json"))["trust"];
  const double share = trust["unfamiliar"].get<double>();
  const auto of_pass = trust["unfamiliar_of_pass"].get<std::vector<double>>();
  EXPECT_LE(*std::ranges::min_element(of_pass), share);
  EXPECT_GE(*std::ranges::max_element(of_pass), share);
  std::string recording;
  for (const auto& entry : fs::directory_iterator(path("data")))
    if (entry.path().extension() == ".safetensors") recording = entry.path().string();
  const ProcessResult live =
      run_process("supertac-stream", {"--model", both, "--recording", recording, "--out",
                                      path("live.safetensors"), "--json", path("live.json")});
  ASSERT_EQ(live.code, 0) << live.error;
  const SafetensorsFile seen = SafetensorsFile::read(path("live.safetensors"));
  EXPECT_EQ(seen.tensors().at("unfamiliar").shape, seen.tensors().at("time_s").shape);
  EXPECT_TRUE(parse_json_limited(bytes("live.json")).contains("unfamiliar"));
}

// What a network left out decides what it is tested on, not its seed.
TEST_F(SeveralModels, NetworksThatLeftOutTheSamePlateAreAveraged) {
  const std::string data = path("plates");
  ASSERT_EQ(run_process("supertac-simulate", {"--out", data, "--plates", "6_Bumps,6_Ridges", "--passes", "1",
                                              "--trials", "1", "--speeds", "30"})
                .code,
            0);
  const auto train_without = [&](const char* plate, const char* seed, const std::string& out) {
    std::vector<std::string> words =
        options(out, {"--split", "texture", "--leave-out", plate, "--seed", seed, "--epochs", "1"});
    words[1] = data;
    ASSERT_EQ(run_process("supertac-train", words).code, 0);
  };
  train_without("6_Bumps", "1", "left1.safetensors");
  train_without("6_Bumps", "2", "left2.safetensors");
  train_without("6_Ridges", "1", "other.safetensors");
  const auto judge = [&](const char* other) {
    return run_process("supertac-evaluate", {"--model", path("left1.safetensors") + "," + path(other),
                                             "--data", data, "--limit", "20"});
  };
  const ProcessResult good = judge("left2.safetensors"), leak = judge("other.safetensors");
  EXPECT_EQ(good.code, 0) << good.error;
  EXPECT_EQ(leak.code, 1);
  EXPECT_NE(leak.error.find("by left-out plate 6_Bumps, of another by left-out plate 6_Ridges"),
            std::string::npos)
      << leak.error;
}

}  // namespace
}  // namespace supertac
