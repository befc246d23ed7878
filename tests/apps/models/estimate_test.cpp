// Every long command says after its first seconds how long it takes; each is stopped once it has. What ends
// within fifteen seconds need not.
#include <unistd.h>

#include <filesystem>
#include <regex>

#include "data/recordings/recording.h"
#include "tests/apps/common/trained.h"

namespace supertac {
namespace {

class Estimate : public Training {
 protected:
  static void expect(const std::string& line, const std::string& what) {
    const std::string file = path("said");
    std::filesystem::remove(file);
    RunningProcess process("/bin/sh", {"-c", "exec " SUPERTAC_BIN "/" + line + " 2>said"},
                           {.folder = folder_->path()});
    const std::regex estimate(what + ": about [0-9.]+ (seconds|minutes|hours) to go\n");
    std::string said;
    const auto found = [&] { return std::regex_search(said, estimate); };
    for (int i = 0; i < 4000 && !found() && !process.ended(); ++i) {
      ::usleep(50'000);
      if (std::filesystem::exists(file)) said = bytes("said");
    }
    if (found()) return;
    // Who ends within these minutes never had long to go: parts that only look short are no promise broken.
    EXPECT_TRUE(process.ended() && process.wait().code == 0) << line << ": " << said;
  }
};

TEST_F(Estimate, OfATraining) {
  expect("supertac-train" + options("long.safetensors", "--epochs 5000"), "training");
}

TEST_F(Estimate, OfASweep) {
  expect("supertac-sweep" + options("sweep", "--epochs 5000 --seeds 0,1"), "1 of 2 .*");
}

TEST_F(Estimate, OfASimulation) { expect("supertac-simulate --out many --trials 100", "simulating"); }

TEST_F(Estimate, OfGradientChecks) { expect("supertac-check gradients", "checking"); }

TEST_F(Estimate, OfAnImport) {
  const Recording pass = read_recording(list_recordings(path("data")).front());
  std::string text;
  for (std::size_t i = 0; i < pass.signals.size(); ++i)
    text += std::to_string(pass.signals[i]) + (i % 16 == 15 ? '\n' : ' ');
  const std::string plate = path("text/3_Bumps");
  for (int k = 1; k <= 1000; ++k) std::filesystem::create_directories(plate + "/" + std::to_string(k));
  write_file(plate + "/1/1.txt", text);
  for (int k = 2; k <= 1000; ++k)
    std::filesystem::create_hard_link(plate + "/1/1.txt", plate + "/" + std::to_string(k) + "/1.txt");
  expect("supertac-import text --out imported --threads 1", "importing");
}

TEST_F(Estimate, OfAnAudit) {
  trained("short.safetensors", "--epochs 60 --batch 64 --ledger 40");
  expect("supertac-check training short.safetensors --data data --segments 1000 --threads 1", "repeating");
}

TEST_F(Estimate, OfWhatIsDoneWithAModel) {
  succeed("supertac-simulate --out two --plates 3_Bumps,6_Ridges --speeds 5 --passes 2");
  succeed("supertac-train --data two --out fine.safetensors --scale 8 --epochs 1 --stride 64");
  expect("supertac-classify --model fine.safetensors --data two --stride 1 --seeds 1000", "classifying");
  expect("supertac-evaluate --model fine.safetensors --data two --threads 1", "evaluating");
}

// On a terminal the bar has epoch, loss and SSIM of the test side.
TEST_F(Estimate, TheBarOfATrainingShowsEpochLossAndTestSsim) {
  const ProcessResult made =
      succeed("supertac-train" + options("shown.safetensors", "--epochs 500 --batch 64"), {.terminal = true});
  EXPECT_TRUE(std::regex_search(
      made.error,
      std::regex(
          R"(training  \[#+\.*\]  \d+ %  epoch \d+/500 loss \d*\.\d+ test SSIM -?\d*\.\d+  \d+:\d\d left)")))
      << made.error;
}

}  // namespace
}  // namespace supertac
