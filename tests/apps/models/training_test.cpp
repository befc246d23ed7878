// supertac-train and supertac-evaluate as processes: same bits, exact resume, bad input.
#include <gtest/gtest.h>
#include <cstdlib>
#include <filesystem>
#include <functional>

#include "data/recordings/recording.h"
#include "io/files/json.h"
#include "io/files/provenance.h"
#include "io/files/safetensors.h"
#include "tests/apps/common/trained.h"

namespace supertac {
namespace {

namespace fs = std::filesystem;

// The sets that this processor has, after SUPERTAC_ISA's names; portable always runs.
std::vector<std::string> instruction_sets() {
  std::vector<std::string> sets{"portable"};
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) sets.push_back("avx2");
  if (__builtin_cpu_supports("avx512f")) sets.push_back("avx512");
#endif
  return sets;
}

ProcessResult train_with(const std::string& set, const std::function<ProcessResult()>& run) {
  ::setenv("SUPERTAC_ISA", set.c_str(), 1);
  ProcessResult result = run();
  ::unsetenv("SUPERTAC_ISA");
  return result;
}

// What a newcomer met: the reason comes with the refusal.
TEST_F(Training, SaysWhyAFinishedRunIsNotResumed) {
  ASSERT_EQ(train("done.safetensors", {"--epochs", "1", "--stride", "64"}).code, 0);
  const ProcessResult resumed = train(
      "done.safetensors", {"--epochs", "1", "--stride", "64", "--resume", path("done.run/last.safetensors")});
  EXPECT_EQ(resumed.code, 1);
  EXPECT_NE(resumed.error.find("the run that --resume continues has ended"), std::string::npos)
      << resumed.error;
}

TEST_F(Training, SaysWhereItsTemporaryFileCannotBeMade) {
  ::setenv("TMPDIR", path("nowhere").c_str(), 1);
  const ProcessResult result = train("nowhere.safetensors");
  ::unsetenv("TMPDIR");
  EXPECT_EQ(result.code, 1);
  EXPECT_NE(result.error.find("cannot make a temporary file there: No such file or directory; set TMPDIR"),
            std::string::npos)
      << result.error;
}

TEST_F(Training, AWarningOfCollapseSaysThatItOftenMendsItself) {
  const ProcessResult result = train("idle.safetensors", {"--beta", "100", "--epochs", "12"});
  EXPECT_EQ(result.code, 0) << result.error;
  EXPECT_NE(
      result.error.find("no latent number tells windows apart; if that stays so, lower --beta (now 100)"),
      std::string::npos)
      << result.error;
  EXPECT_NE(result.error.find("early in a run it often mends itself: watch SSIM"), std::string::npos);
}

TEST_F(Training, NamesThePlatesThereAre) {
  const ProcessResult result = train("none.safetensors", {"--plates", "6_Bump"});
  EXPECT_NE(result.error.find("plate '6_Bump' has no recording in " + path("data") + "; it has those of "),
            std::string::npos)
      << result.error;
}

TEST_F(Training, EvaluationWritesTheSameBytesForEveryBatch) {
  ASSERT_EQ(train("batches.safetensors", {"--epochs", "1", "--stride", "64"}).code, 0);
  std::string first;
  for (const char* batch : {"64", "7", "1"}) {
    const std::string outputs = path("outputs.safetensors");
    const ProcessResult result = run_process(
        "supertac-evaluate", {"--model", path("batches.safetensors"), "--data", path("data"), "--limit", "20",
                              "--batch", batch, "--outputs", outputs, "--force"});
    ASSERT_EQ(result.code, 0) << result.error;
    const std::string bytes = read_text_file(outputs, 1 << 24);
    if (first.empty()) first = bytes;
    EXPECT_TRUE(bytes == first) << "batch " << batch;
  }
}

TEST_F(Training, EvaluationSaysThatSplitNoneHasSeenItAll) {
  ASSERT_EQ(train("seen.safetensors", {"--epochs", "1", "--stride", "64", "--split", "none"}).code, 0);
  const ProcessResult result = run_process(
      "supertac-evaluate", {"--model", path("seen.safetensors"), "--data", path("data"), "--limit", "20"});
  EXPECT_NE(result.error.find("it has seen every one of them"), std::string::npos) << result.error;
}

TEST_F(Training, EvaluationWarnsOfSignalsThroughAnotherFilter) {
  const ProcessResult trained = train("filtered.safetensors", {"--epochs", "1"});
  ASSERT_EQ(trained.code, 0) << trained.error;
  const ProcessResult made =
      run_process("supertac-simulate", {"--out", path("raw"), "--plates", "3_Bumps", "--speeds", "10",
                                        "--passes", "1", "--without", "filter"});
  ASSERT_EQ(made.code, 0) << made.error;
  const auto warning_on = [](const std::string& data) {
    return run_process("supertac-evaluate",
                       {"--model", path("filtered.safetensors"), "--data", path(data), "--limit", "20"})
        .error.find("a moving average of 0 s, those of the training through one of 0.0992 s");
  };
  EXPECT_NE(warning_on("raw"), std::string::npos);
  EXPECT_EQ(warning_on("data"), std::string::npos);
}

TEST_F(Training, HelpSaysWhatTinyCosts) {
  EXPECT_NE(run_process("supertac-train", {"--help"}).out.find("a ninth of the"), std::string::npos);
}

// Every set with every number of threads, over fewer steps: Trainer.PinnedBits.
TEST_F(Training, TwoHundredStepsGiveTheSameBytesOnEverySetAndAnyThreads) {
  std::string first;
  for (const std::string& set : instruction_sets()) {
    const bool slow = set == "portable";
    for (const char* threads : slow ? std::vector{"2"} : std::vector{"1", "2", "4"}) {
      const std::string name = set + threads;
      const ProcessResult result = train_with(set, [&] {
        return train(name + ".safetensors",
                     {"--rate", "300", "--stride", "4", "--epochs", "5", "--threads", threads, "--json",
                      path(name + ".json"), "--checkpoint-every", "1000"});
      });
      ASSERT_EQ(result.code, 0) << result.error;
      ASSERT_GE(parse_json_limited(bytes(name + ".json"))["steps"].get<int>(), 200);
      const std::string model = bytes(name + ".safetensors") + bytes(name + ".run/last.safetensors");
      if (first.empty()) first = model;
      EXPECT_TRUE(model == first) << name << " differs from the first set's";
    }
  }
}

TEST_F(Training, AnUnknownInstructionSetIsRefused) {
  const ProcessResult result = train_with("sparc", [] { return train("unknown.safetensors"); });
  EXPECT_EQ(result.code, 1);
  EXPECT_NE(result.error.find("SUPERTAC_ISA=sparc: not a known instruction set"), std::string::npos)
      << result.error;
}

TEST_F(Training, InterruptedAndResumedGivesTheSameBytes) {
  const std::vector<std::string> longer{"--epochs", "12", "--threads", "1"};
  std::vector<std::string> base{
      "--data",  path("data"), "--timesteps", "32", "--latent",           "3", "--scale", "2",
      "--batch", "8",          "--stride",    "8",  "--checkpoint-every", "5"};
  const auto run = [&](const std::string& out, std::vector<std::string> more,
                       const ProcessOptions& how = {}) {
    std::vector<std::string> all = base;
    all.insert(all.end(), {"--out", path(out)});
    all.insert(all.end(), longer.begin(), longer.end());
    all.insert(all.end(), more.begin(), more.end());
    return run_process("supertac-train", all, how);
  };
  ASSERT_EQ(run("whole.safetensors", {}).code, 0);
  for (const int signal : {SIGINT, SIGTERM, SIGKILL}) {
    const std::string name = "cut" + std::to_string(signal);
    const std::string state = path(name + ".run/last.safetensors");
    const ProcessResult cut = run(name + ".safetensors", {}, {.signal = signal, .signal_when = state});
    EXPECT_EQ(cut.code, 128 + signal) << cut.error;
    EXPECT_FALSE(fs::exists(path(name + ".safetensors")));
    // what a kill -9 in mid-write leaves, of a process whose number is above the largest there is
    write_file(path(name + ".run/last.safetensors.tmp-4194305-1"), "half a state");
    const ProcessResult resumed = run(name + ".safetensors", {"--resume", state});
    ASSERT_EQ(resumed.code, 0) << resumed.error;
    for (const auto& entry : fs::directory_iterator(path(name + ".run"))) {
      EXPECT_EQ(entry.path().string().find(".tmp-"), std::string::npos) << entry.path();
    }
    EXPECT_TRUE(bytes("whole.safetensors") == bytes(name + ".safetensors")) << "signal " << signal;
  }
}

TEST_F(Training, RandomPlatesGiveTheSameBytesAndAreNamedInTheModel) {
  for (const char* threads : {"1", "2"}) {
    const ProcessResult result = train(std::string("random") + threads + ".safetensors",
                                       {"--random-plates", "5", "--epochs", "1", "--threads", threads});
    ASSERT_EQ(result.code, 0) << result.error;
  }
  EXPECT_EQ(bytes("random1.safetensors"), bytes("random2.safetensors"));
  const SafetensorsFile file = SafetensorsFile::read(path("random1.safetensors"));
  EXPECT_EQ(file.metadata().at("random_plates"), "5");
  EXPECT_TRUE(file.tensors().contains("upsampler.spread.weight"));
  EXPECT_TRUE(file.tensors().contains("novelty.mean"));
}

// The same signals, once as the simulated finger's and once as a real one's.
TEST_F(Training, RandomPlatesBesideARealFingerAreFeltByOtherFingers) {
  fs::create_directories(path("real"));
  for (const auto& entry : fs::directory_iterator(path("data"))) {
    if (entry.path().extension() != ".safetensors") continue;
    Recording pass = read_recording(entry.path());
    pass.source = "imported";
    write_recording(path("real/" + entry.path().filename().string()), pass);
  }
  const auto weights = [](const std::string& name, const std::string& data, std::vector<std::string> more) {
    more.insert(more.end(), {"--data", path(data), "--epochs", "1"});
    const ProcessResult result = train(name + ".safetensors", std::move(more));
    EXPECT_EQ(result.code, 0) << result.error;
    return SafetensorsFile::read(path(name + ".safetensors")).f32("upsampler.fc.weight");
  };
  EXPECT_EQ(weights("one", "data", {}), weights("another", "real", {}));
  const auto other = weights("other", "real", {"--random-plates", "5"});
  EXPECT_NE(weights("own", "data", {"--random-plates", "5"}), other);
}

// Whoever links the library trains what the program trains.
TEST_F(Training, TheExampleEndsWithTheProgramsHash) {
  const ProcessResult program =
      run_process("supertac-train", {"--data", path("data"), "--out", path("program.safetensors"), "--preset",
                                     "tiny", "--epochs", "1", "--stride", "64"});
  ASSERT_EQ(program.code, 0) << program.error;
  const ProcessResult example =
      run_process(SUPERTAC_TRAIN_EXAMPLE, {path("data"), path("example.safetensors"), "1", "64"});
  ASSERT_EQ(example.code, 0) << example.error;
  const std::string hash = content_hash(SafetensorsFile::read(path("program.safetensors")));
  EXPECT_NE(example.out.find("content " + hash), std::string::npos) << example.out << hash;
}

TEST_F(Training, LikeRepeatsATrainingToTheSameContent) {
  const std::string one = path("first.safetensors"), again = path("again.safetensors");
  ASSERT_EQ(train("first.safetensors",
                  {"--preset", "best", "--seed", "7", "--split", "pass", "--stride", "128", "--epochs", "1",
                   "--random-plates", "2", "--grouping", "vertical", "--lambda", "0.2"})
                .code,
            0);
  const ProcessResult like =
      run_process("supertac-train", {"--data", path("data"), "--out", again, "--like", one});
  ASSERT_EQ(like.code, 0) << like.error;
  EXPECT_EQ(content_hash(SafetensorsFile::read(one)), content_hash(SafetensorsFile::read(again)));
  const SafetensorsFile file = SafetensorsFile::read(again);
  EXPECT_NE(file.metadata().at("settings").find("\"preset\":\"best\""), std::string::npos);
  EXPECT_NE(file.metadata().at("training").find("\"optimizer\":\"muon\""), std::string::npos);
  const ProcessResult other =
      run_process("supertac-train",
                  {"--data", path("data"), "--out", path("other.safetensors"), "--like", one, "--seed", "8"});
  ASSERT_EQ(other.code, 0) << other.error;
  EXPECT_NE(content_hash(SafetensorsFile::read(one)),
            content_hash(SafetensorsFile::read(path("other.safetensors"))));
  const ProcessResult both = run_process(
      "supertac-train",
      {"--data", path("data"), "--out", path("no.safetensors"), "--like", one, "--preset", "tiny"});
  EXPECT_EQ(both.code, 2);
  EXPECT_NE(both.error.find("expected --preset NAME or --like MODEL, found both"), std::string::npos)
      << both.error;
}

TEST_F(Training, DataThatTeachNothingAreRemarkedOnAndRefusedUnderStrict) {
  ASSERT_EQ(run_process("supertac-simulate",
                        {"--out", path("plain"), "--plates", "plain", "--speeds", "10", "--passes", "1"})
                .code,
            0);
  const std::string remark = "every truth is 0 everywhere: nothing can be learnt";
  const ProcessResult said = train("nothing.safetensors", {"--data", path("plain"), "--epochs", "1"});
  EXPECT_EQ(said.code, 0) << said.error;
  EXPECT_NE(said.error.find("warning: " + remark), std::string::npos) << said.error;
  const ProcessResult refused = train("strict.safetensors", {"--data", path("plain"), "--strict"});
  EXPECT_EQ(refused.code, 1);
  EXPECT_NE(refused.error.find(remark), std::string::npos) << refused.error;
  EXPECT_FALSE(fs::exists(path("strict.safetensors")) || fs::exists(path("strict.run")));
  const ProcessResult scored = run_process(
      "supertac-evaluate",
      {"--model", path("nothing.safetensors"), "--data", path("plain"), "--limit", "20", "--strict"});
  EXPECT_EQ(scored.code, 1);
  EXPECT_NE(scored.error.find(remark), std::string::npos) << scored.error;
}

TEST_F(Training, EvaluationWritesTheAgreedJsonAndOutputs) {
  ASSERT_EQ(train("scored.safetensors").code, 0);
  const std::string page = bytes("scored.run/report.html");
  for (const char* part :
       {"SSIM, linear axes", "1 - SSIM, logarithmic axes", "test pictures in contact", "Settings"})
    EXPECT_NE(page.find(part), std::string::npos) << part;
  for (const char* outside : {"http://", "https://", "<!--", "{{"})
    EXPECT_EQ(page.find(outside), std::string::npos) << outside;
  const ProcessResult result = run_process(
      "supertac-evaluate",
      {"--model", path("scored.safetensors"), "--data", path("data"), "--json", path("scores.json"),
       "--outputs", path("outputs.safetensors"), "--limit", "40", "--pictures", path("pictures")});
  ASSERT_EQ(result.code, 0) << result.error;
  const auto json = parse_json_limited(bytes("scores.json"));
  for (const auto* scores : {&json, &json["baselines"]["mean_image"], &json["baselines"]["nearest"],
                             &json["baselines"]["bicubic"]}) {
    for (const char* part : {"all", "contact"}) {
      for (const char* key : {"windows", "psnr_mean_db", "psnr_pooled_db", "ssim", "phase_correlation",
                              "phase_correlation_floor", "position_error_px", "position_error_mm"}) {
        EXPECT_TRUE((*scores)[part].contains(key)) << part << " " << key;
      }
    }
  }
  for (const char* part : {"flat", "air"}) EXPECT_TRUE(json[part].contains("ghost_rate")) << part;
  EXPECT_TRUE(json["contact"].contains("miss_rate"));
  for (const char* key : {"factor", "coverage", "factor_found", "sure_ssim", "auroc", "unlike_training"})
    EXPECT_TRUE(json["trust"].contains(key)) << key;
  const SafetensorsFile outputs = SafetensorsFile::read(path("outputs.safetensors"));
  EXPECT_EQ(outputs.tensors().at("input").shape, (std::vector<std::uint64_t>{40, 32, 16}));
  EXPECT_EQ(outputs.tensors().at("output").shape, (std::vector<std::uint64_t>{40, 8, 8}));
  EXPECT_EQ(outputs.tensors().at("predicted_error").shape, (std::vector<std::uint64_t>{40, 8, 8}));
  EXPECT_TRUE(fs::exists(path("pictures/strips.png")));
}

TEST_F(Training, BadInputIsOneLineAndLeavesNothingBehind) {
  ASSERT_EQ(train("good.safetensors").code, 0);
  std::string damaged = bytes("good.safetensors");
  damaged[damaged.size() / 2] ^= 1;
  write_file(path("damaged.safetensors"), damaged);
  write_file(path("cut.safetensors"), std::string_view(damaged).substr(0, 1000));
  fs::create_directories(path("empty"));
  const std::string data = path("data"), out = path("never.safetensors"), good = path("good.safetensors");
  struct Bad {
    std::vector<std::string> arguments;
    int code;
    std::string message;
  };
  const std::vector<Bad> cases{
      {{"supertac-train", "--data", data, "--out", out, "--timesteps", "40"}, 2, "multiple of 16"},
      {{"supertac-train", "--data", data, "--out", out, "--timesteps", "1024"}, 2, "--timesteps"},
      {{"supertac-train", "--data", data, "--out", out, "--scale", "3"}, 2, "--scale"},
      {{"supertac-train", "--data", data, "--out", out, "--preset", "huge"}, 2, "--preset"},
      {{"supertac-train", "--data", data, "--out", out, "--epoch", "3"}, 2, "--epochs"},
      {{"supertac-train", "--data", data, "--out", out, "--split", "texture"}, 1, "texture"},
      {{"supertac-train", "--data", path("empty"), "--out", out}, 1, path("empty")},
      {{"supertac-train", "--data", path("absent"), "--out", out}, 1, path("absent")},
      {{"supertac-train", "--data", data, "--out", good}, 1, "--force"},
      {{"supertac-train", "--data", data, "--out", path("absent/x.safetensors")}, 1, path("absent")},
      {{"supertac-train", "--data", data, "--out", out, "--plates", "6_Bumps"}, 1, "6_Bumps"},
      {{"supertac-train", "--data", data, "--out", out, "--leave-out", "3_Bumps"}, 2, "--split texture"},
      {{"supertac-train", "--data", data, "--out", out, "--resume", good}, 1, "cannot resume"},
      {{"supertac-evaluate", "--model", path("damaged.safetensors"), "--data", data},
       1,
       "damaged.safetensors"},
      {{"supertac-evaluate", "--model", path("cut.safetensors"), "--data", data}, 1, "cut.safetensors"},
      {{"supertac-evaluate", "--model", path("absent"), "--data", data}, 1, "absent"},
      {{"supertac-train", "--data", data, "--out", out, "--autoencoder", "plain", "--beta", "1"},
       2,
       "--beta: has no part in a plain autoencoder"},
      {{"supertac-evaluate", "--model", good}, 2, "--data"},
  };
  for (const Bad& bad : cases) {
    const ProcessResult result = run_process(
        bad.arguments[0], std::vector<std::string>(bad.arguments.begin() + 1, bad.arguments.end()));
    std::string line;
    for (const std::string& word : bad.arguments) line += word + " ";
    EXPECT_EQ(result.code, bad.code) << line << result.error;
    EXPECT_NE(result.error.find(bad.message), std::string::npos) << line << result.error;
    EXPECT_EQ(std::count(result.error.begin(), result.error.end(), '\n'), 1) << line << result.error;
  }
  EXPECT_FALSE(fs::exists(path("never.safetensors")));
  EXPECT_FALSE(fs::exists(path("never.run")));
  EXPECT_EQ(bytes("damaged.safetensors"), damaged);
}

}  // namespace
}  // namespace supertac
