// supertac-classify as a process: results, same bits, and what it refuses.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>

#include "io/files/file.h"
#include "io/files/json.h"
#include "models/files/classifier_file.h"
#include "tests/apps/common/process.h"
#include "tests/io/temporary_folder.h"

namespace supertac {
namespace {

class Classify : public testing::Test {
 protected:
  // Two plates that differ in pitch, two trials; a model that has seen the first.
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    const ProcessResult made = run_process(
        "supertac-simulate",
        {"--out", path("data"), "--plates", "3_Bumps,6_Ridges", "--speeds", "10", "--passes", "2"});
    ASSERT_EQ(made.code, 0) << made.error;
    for (const char* split : {"trial", "none", "pass"}) train(split);
  }
  static void TearDownTestSuite() { folder_.reset(); }

  static void train(const std::string& split) {
    const ProcessResult made = run_process(
        "supertac-train", {"--data", path("data"), "--out", path(split), "--timesteps", "32", "--latent", "3",
                           "--rate", "300", "--stride", "16", "--epochs", "1", "--split", split});
    ASSERT_EQ(made.code, 0) << made.error;
  }
  static std::string path(const std::string& name) { return *folder_ / name; }
  static ProcessResult classify(const std::string& model, const std::vector<std::string>& more) {
    std::vector<std::string> all{"--model", model, "--data", path("data"), "--stride", "1"};
    all.insert(all.end(), more.begin(), more.end());
    return run_process("supertac-classify", all);
  }

  static std::unique_ptr<TemporaryFolder> folder_;
};
std::unique_ptr<TemporaryFolder> Classify::folder_;

TEST_F(Classify, KeepsAClassifierThatNamesTextures) {
  ASSERT_EQ(classify(path("trial"),
                     {"--seeds", "1", "--epochs", "2", "--views", "super_resolved", "--out", path("kept")})
                .code,
            0);
  const NamedClassifier kept = load_classifier(path("kept"));
  EXPECT_EQ(kept.names, (std::vector<std::string>{"3_Bumps", "6_Ridges"}));
  const auto answer = kept.name_of(std::vector<float>(256, 0.5F));
  EXPECT_TRUE(std::ranges::count(kept.names, answer.name) == 1 && answer.probability >= 0.5 &&
              answer.probability <= 1);
  EXPECT_THROW((void)kept.name_of(std::vector<float>(64)), std::invalid_argument);
  EXPECT_THROW((void)load_classifier(path("trial")), std::runtime_error);
  EXPECT_EQ(classify(path("trial"), {"--views", "frame", "--out", path("no_file")}).code, 2);
}

TEST_F(Classify, CountsEveryTestWindowAndKnowsTheTruth) {
  const ProcessResult result =
      classify(path("trial"), {"--seeds", "2", "--epochs", "20", "--json", path("scores.json"), "--views",
                               "frame,super_resolved,latents,history32,truth"});
  ASSERT_EQ(result.code, 0) << result.error;
  const auto json = parse_json_limited(read_text_file(path("scores.json"), 1 << 20));
  EXPECT_EQ(json["split"], "trial");
  for (const char* view : {"frame", "super_resolved", "latents", "history32", "truth"}) {
    const auto& parts = json["views"][view];
    EXPECT_LT(parts["inside"]["windows"], parts["contact"]["windows"]) << view;
    EXPECT_LT(parts["contact"]["windows"], parts["all"]["windows"]) << view;
    EXPECT_EQ(parts["all"]["passes"], 4);
    EXPECT_EQ(parts["all"]["accuracy_of_runs"].size(), 2u);
    std::uint64_t counted = 0;
    for (const auto& row : parts["all"]["confusion"]) {
      for (const auto& cell : row) counted += cell.get<std::uint64_t>();
    }
    EXPECT_EQ(counted, 2 * parts["all"]["windows"].get<std::uint64_t>()) << view;
    EXPECT_LE(parts["all"]["ci95_passes"][0], parts["all"]["accuracy"]);
    EXPECT_GE(parts["all"]["ci95_passes"][1], parts["all"]["accuracy"]);
    EXPECT_EQ(parts["all"].contains("p_against_frame"), std::string(view) != "frame");
  }
  EXPECT_GT(json["views"]["truth"]["inside"]["accuracy"], 0.9) << "these plates differ wherever one looks";
}

TEST_F(Classify, SameBytesForOneAndTwoThreads) {
  for (const char* threads : {"1", "2"}) {
    ASSERT_EQ(classify(path("trial"),
                       {"--seeds", "2", "--epochs", "1", "--threads", threads, "--json", path(threads)})
                  .code,
              0);
  }
  const auto views = [](const char* name) {
    return parse_json_limited(read_text_file(path(name), 1 << 20))["views"].dump();
  };
  EXPECT_EQ(views("1"), views("2"));
}

TEST_F(Classify, RefusesModelsThatMayHaveSeenTheTest) {
  const struct {
    std::string model;
    std::vector<std::string> more;
    int code;
    const char* message;
  } cases[] = {
      {path("none"), {}, 1, "split none"},
      {path("trial") + "," + path("pass"), {}, 1, "its split is pass, that of"},
      {path("pass"), {"--plates", "6_Ridges,3_Bumps", "--data", path("other")}, 1, "cannot be repeated"},
      {path("trial"), {"--plates", "3_Bumps"}, 1, "one plate"},
      {path("trial"), {"--views", "frame,history20"}, 2, "unknown view \"history20\""},
      {path("trial"), {"--views", "history64"}, 1, "longer than the 32"}};
  ASSERT_EQ(run_process("supertac-simulate", {"--out", path("other"), "--plates", "3_Bumps,6_Ridges",
                                              "--speeds", "10", "--trials", "1", "--passes", "2"})
                .code,
            0);
  for (const auto& c : cases) {
    std::vector<std::string> all{"--model", c.model, "--epochs", "1", "--seeds", "1"};
    if (std::find(c.more.begin(), c.more.end(), "--data") == c.more.end())
      all.insert(all.end(), {"--data", path("data")});
    all.insert(all.end(), c.more.begin(), c.more.end());
    const ProcessResult result = run_process("supertac-classify", all);
    EXPECT_EQ(result.code, c.code) << c.message << result.error;
    EXPECT_NE(result.error.find(c.message), std::string::npos) << result.error;
  }
}

}  // namespace
}  // namespace supertac
