// supertac-evaluate and supertac-stream with several models: averaged or refused.
#include <gtest/gtest.h>

#include "io/files/json.h"
#include "tests/apps/common/trained.h"

namespace supertac {
namespace {

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
    EXPECT_NE(result.error.find("tested is split trial: if these are the recordings of its training"),
              std::string::npos)
        << result.error;
    return parse_json_limited(bytes("average.json"))["all"]["ssim"].get<double>();
  };
  const double a = ssim(one), b = ssim(two), both = ssim(one + "," + two);
  EXPECT_NE(both, a);
  EXPECT_NE(both, b);
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
