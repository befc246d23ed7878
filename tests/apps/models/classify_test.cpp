// supertac-classify as a process: results, same bits, and what it refuses.
#include "io/files/json.h"
#include "tests/apps/common/expect.h"
#include "tests/support/test.h"

namespace supertac::classify_test {

class Classify : public OnSimulatedData {
 protected:
  // Two plates that differ in pitch, two trials; a model that has seen the first.
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    succeed("supertac-simulate --out data --plates 3_Bumps,6_Ridges --speeds 10 --passes 2");
    for (const std::string split : {"trial", "none", "pass"})
      succeed(
          "supertac-train --data data --timesteps 32 --latent 3 --rate 300 --stride 16 --epochs 1 --out " +
          split + " --split " + split);
  }
};

const std::string kClassify = "supertac-classify --data data --model ";

TEST_F(Classify, CountsEveryTestWindowAndTellsTexturesApart) {
  succeed(kClassify + "trial --seeds 2 --epochs 20 --json scores.json");
  const auto scores = json("scores.json");
  EXPECT_EQ(scores["split"], "trial");
  for (const char* view : {"frame", "super_resolved", "latents"}) {
    const auto& parts = scores["views"][view];
    EXPECT_LT(parts["inside"]["windows"], parts["contact"]["windows"]) << view;
    EXPECT_LT(parts["contact"]["windows"], parts["all"]["windows"]) << view;
    EXPECT_EQ(parts["all"]["passes"], 4);
    EXPECT_EQ(parts["all"]["accuracy_of_runs"].size(), 2u);
    EXPECT_LE(parts["all"]["ci95_passes"][0], parts["all"]["accuracy"]);
    EXPECT_GE(parts["all"]["ci95_passes"][1], parts["all"]["accuracy"]);
    EXPECT_EQ(parts["all"].contains("p_against_frame"), std::string(view) != "frame");
  }

  // Two plates that differ wherever one looks; passes of one trial.
  succeed(kClassify + "pass --seeds 1 --epochs 30 --json pass.json");
  EXPECT_GT(json("pass.json")["views"]["frame"]["inside"]["accuracy"], 0.65);
}

TEST_F(Classify, SameBytesForOneAndTwoThreads) {
  for (const std::string threads : {"1", "2"})
    succeed(kClassify + "trial --seeds 2 --epochs 1 --threads " + threads + " --json " + threads);
  const auto views = [](const char* name) { return json(name)["views"].dump(); };
  EXPECT_EQ(views("1"), views("2"));
}

TEST_F(Classify, RefusesModelsThatMayHaveSeenTheTest) {
  const struct {
    std::string options;
    int code;
    const char* message;
  } cases[] = {{"none", 1, "split none"},
               {"trial,pass", 1, "its split is pass, that of"},
               {"pass --plates 6_Ridges,3_Bumps --data other", 1, "cannot be repeated"},
               {"trial --plates 3_Bumps", 1, "one plate"}};
  succeed("supertac-simulate --out other --plates 3_Bumps,6_Ridges --speeds 10 --trials 1 --passes 2");
  for (const auto& [options, code, message] : cases)
    expect_exit(run("supertac-classify --data data --epochs 1 --seeds 1 --model " + options), code, message);
}

}  // namespace supertac::classify_test
