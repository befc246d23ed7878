// supertac-evaluate and supertac-stream with several models: averaged or refused.
#include "io/files/json.h"
#include "tests/apps/common/trained.h"
#include "tests/support/test.h"

namespace supertac::several_models_test {

using SeveralModels = Training;

TEST_F(SeveralModels, AreAveragedUnlessTheySawEachOthersTest) {
  const std::string one = "one.safetensors", two = "two.safetensors", all = "all.safetensors";
  const std::string evaluate = "supertac-evaluate --data data --limit 20 --model ";
  trained(one, "--seed 1 --split pass");
  trained(two, "--seed 2 --split pass");
  trained(all, "--split none");
  expect_exit(run(evaluate + one + "," + two), 1, "drawn by seed 1, of another by seed 2");
  expect_exit(run(evaluate + one + "," + all), 1, "split pass, another with none");
  succeed(evaluate + one + "," + all + " --split none");
  EXPECT_TRUE(contains(run(evaluate + all).error, "it has seen every one of them"));

  const auto ssim = [&](const std::string& models) {
    const ProcessResult result =
        succeed(evaluate + models + " --split trial --limit 60 --json average.json --force");
    EXPECT_TRUE(contains(result.error, "tested is split trial: if these are the recordings of its training"));
    return parse_json_limited(bytes("average.json"))["all"]["ssim"].get<double>();
  };
  const double a = ssim(one), b = ssim(two), both = ssim(one + "," + two);
  EXPECT_NE(both, a);
  EXPECT_NE(both, b);
}

// What a network left out decides what it is tested on, not its seed.
TEST_F(SeveralModels, NetworksThatLeftOutTheSamePlateAreAveraged) {
  succeed("supertac-simulate --out plates --plates 6_Bumps,6_Ridges --passes 1 --trials 1 --speeds 30");
  const std::string without = "--data plates --split texture --epochs 1 --leave-out ";
  trained("left1.safetensors", without + "6_Bumps --seed 1");
  trained("left2.safetensors", without + "6_Bumps --seed 2");
  trained("other.safetensors", without + "6_Ridges --seed 1");
  const std::string evaluate = "supertac-evaluate --data plates --limit 20 --model left1.safetensors,";
  succeed(evaluate + "left2.safetensors");
  expect_exit(run(evaluate + "other.safetensors"), 1,
              "by left-out plate 6_Bumps, of another by left-out plate 6_Ridges");
}

}  // namespace supertac::several_models_test
