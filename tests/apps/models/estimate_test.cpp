// Every long command says after its first seconds how long it takes; each is stopped once it has. What ends
// within fifteen seconds need not.
#include <unistd.h>

#include <filesystem>
#include <regex>

#include "data/recordings/recording.h"
#include "tests/apps/common/simulated_data.h"

namespace supertac {
namespace {

class Estimate : public OnSimulatedData {
 protected:
  static std::vector<std::string> training(std::vector<std::string> more) {
    std::vector<std::string> all{"--data", path("data"), "--timesteps", "32",       "--latent",
                                 "3",      "--scale",    "2",           "--stride", "8"};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }

  static void expect(const std::string& program, const std::vector<std::string>& arguments,
                     const std::string& what) {
    const std::string file = path("said");
    std::vector<std::string> words{"-c", "exec \"$@\" 2>" + file, "sh", SUPERTAC_BIN "/" + program};
    words.insert(words.end(), arguments.begin(), arguments.end());
    std::filesystem::remove(file);
    RunningProcess process("/bin/sh", words);
    const std::regex estimate(what + ": about [0-9.]+ (seconds|minutes|hours) to go\n");
    std::string said;
    const auto found = [&] { return std::regex_search(said, estimate); };
    for (int i = 0; i < 4000 && !found() && !process.ended(); ++i) {
      ::usleep(50'000);
      if (std::filesystem::exists(file)) said = read_text_file(file, 1 << 20);
    }
    if (found()) return;
    // Who ends within these minutes never had long to go: parts that only look short are no promise broken.
    EXPECT_TRUE(process.ended() && process.wait().code == 0) << program << ": " << said;
  }
};

TEST_F(Estimate, OfATraining) {
  expect("supertac-train", training({"--out", path("long.safetensors"), "--epochs", "5000"}), "training");
}

TEST_F(Estimate, OfASweepCountsWhatFollows) {
  expect("supertac-sweep", training({"--out", path("sweep"), "--epochs", "5000", "--seeds", "0,1"}),
         "1 of 2 .* and what follows");
}

TEST_F(Estimate, OfASimulation) {
  expect("supertac-simulate", {"--out", path("many"), "--trials", "100"}, "simulating");
}

TEST_F(Estimate, OfGradientChecks) {
  expect("supertac-check", {"gradients"}, "checking");
  expect("supertac-check", {"gradients", "--break", "all"}, "planting");
}

TEST_F(Estimate, OfAnImport) {
  const Recording pass = read_recording(list_recordings(path("data")).front());
  std::string text;
  for (std::size_t i = 0; i < pass.volts.size(); ++i)
    text += std::to_string(pass.volts[i]) + (i % 16 == 15 ? '\n' : ' ');
  const std::string plate = path("text/3_Bumps");
  for (int k = 1; k <= 1000; ++k) std::filesystem::create_directories(plate + "/" + std::to_string(k));
  write_file(plate + "/1/1.txt", text);
  for (int k = 2; k <= 1000; ++k)
    std::filesystem::create_hard_link(plate + "/1/1.txt", plate + "/" + std::to_string(k) + "/1.txt");
  expect("supertac-import", {path("text"), "--out", path("imported"), "--threads", "1"}, "importing");
}

TEST_F(Estimate, OfAnAudit) {
  const std::string model = path("short.safetensors");
  const auto made =
      run_process("supertac-train", training({"--out", model, "--epochs", "60", "--ledger", "40"}));
  ASSERT_EQ(made.code, 0) << made.error;
  expect("supertac-check",
         {"training", model, "--data", path("data"), "--segments", "1000", "--threads", "1"}, "repeating");
}

TEST_F(Estimate, OfWhatIsDoneWithAModel) {
  const std::string data = path("two"), model = path("fine.safetensors");
  const auto felt = run_process(
      "supertac-simulate", {"--out", data, "--plates", "3_Bumps,6_Ridges", "--speeds", "5", "--passes", "2"});
  ASSERT_EQ(felt.code, 0) << felt.error;
  const auto made = run_process(
      "supertac-train", {"--data", data, "--out", model, "--scale", "8", "--epochs", "1", "--stride", "64"});
  ASSERT_EQ(made.code, 0) << made.error;
  expect("supertac-classify",
         {"--model", model, "--data", data, "--views", "frame", "--stride", "1", "--seeds", "1000"},
         "classifying");
  expect("supertac-evaluate", {"--model", model, "--data", data, "--threads", "1"}, "evaluating");
}

// On a terminal the bar has epoch, loss and SSIM of the test side.
TEST_F(Estimate, TheBarOfATrainingShowsEpochLossAndTestSsim) {
  ProcessOptions options;
  options.terminal = true;
  const auto made = run_process("supertac-train",
                                training({"--out", path("shown.safetensors"), "--epochs", "500"}), options);
  ASSERT_EQ(made.code, 0) << made.error;
  EXPECT_TRUE(std::regex_search(
      made.error,
      std::regex(
          R"(training  \[#+\.*\]  \d+ %  epoch \d+/500 loss \d*\.\d+ test SSIM -?\d*\.\d+  \d+:\d\d left)")))
      << made.error;
}

}  // namespace
}  // namespace supertac
