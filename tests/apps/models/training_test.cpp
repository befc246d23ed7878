// supertac-train and supertac-evaluate as processes: same bits, exact resume, bad input.
#include <regex>

#include "data/recordings/recording.h"
#include "data/scores/metrics.h"
#include "io/files/json.h"
#include "io/files/safetensors.h"
#include "tests/apps/common/expect.h"
#include "tests/support/test.h"

namespace supertac::training_test {

namespace fs = std::filesystem;

TEST_F(Training, SaysWhichVariableOfTheEnvironmentIsWrong) {
  for (const auto& [name, value, said] :
       {std::tuple("TMPDIR", "/nowhere",
                   "cannot make a temporary file there: No such file or directory; set TMPDIR"),
        {"SUPERTAC_ISA", "sparc", "SUPERTAC_ISA=sparc: not a known instruction set"}}) {
    ::setenv(name, value, 1);
    expect_exit(train("none.safetensors"), 1, said);
    ::unsetenv(name);
  }
}

TEST_F(Training, AWarningOfCollapseSaysThatItOftenMendsItself) {
  const ProcessResult result = trained("idle.safetensors", "--beta 100 --epochs 12");
  EXPECT_TRUE(contains(result.error,
                       "no latent number tells windows apart; if that stays so, lower --beta (now 100)"));
  EXPECT_TRUE(contains(result.error, "early in a run it often mends itself: watch SSIM"));
}

TEST_F(Training, EvaluationWarnsOfSignalsThroughAnotherFilter) {
  trained("filtered.safetensors", "--epochs 1");
  succeed("supertac-simulate --out raw --plates 3_Bumps --speeds 10 --passes 1 --sensor rig");
  const auto warned_on = [](const std::string& data) {
    return contains(run("supertac-evaluate --model filtered.safetensors --limit 20 --data " + data).error,
                    "a moving average of 0 s, those of the training through one of 0.0992 s");
  };
  EXPECT_TRUE(warned_on("raw"));
  EXPECT_FALSE(warned_on("data"));
}

TEST_F(Training, InterruptedAndResumedGivesTheSameBytes) {
  const std::string longer = "--checkpoint-every 5 --epochs 12 --threads 1";
  trained("whole.safetensors", longer);
  for (const int signal : {SIGINT, SIGTERM, SIGKILL}) {
    const std::string name = "cut" + std::to_string(signal);
    const std::string state = name + ".run/last.safetensors";
    const ProcessResult cut = run("supertac-train" + options(name + ".safetensors", longer),
                                  {.signal = signal, .signal_when = path(state)});
    EXPECT_EQ(cut.code, 128 + signal) << cut.error;
    EXPECT_FALSE(fs::exists(path(name + ".safetensors")));
    // what a kill -9 in mid-write leaves, of a process whose number is above the largest there is
    write_file(path(state + ".tmp-4194305-1"), "half a state");
    trained(name + ".safetensors", longer + " --resume " + state);
    for (const auto& entry : fs::directory_iterator(path(name + ".run")))
      EXPECT_FALSE(contains(entry.path().string(), ".tmp-"));
    EXPECT_TRUE(bytes("whole.safetensors") == bytes(name + ".safetensors")) << "signal " << signal;
  }
}

TEST_F(Training, RandomPlatesGiveTheSameBytesAndAreNamedInTheModel) {
  for (const std::string threads : {"1", "2"})
    trained("random" + threads + ".safetensors", "--random-plates 5 --epochs 1 --threads " + threads);
  EXPECT_EQ(bytes("random1.safetensors"), bytes("random2.safetensors"));
  const SafetensorsFile file = SafetensorsFile::read(path("random1.safetensors"));
  EXPECT_EQ(file.metadata().at("random_plates"), "5");
  EXPECT_TRUE(file.tensors().contains("upsampler.spread.weight"));
  EXPECT_TRUE(file.tensors().contains("novelty.mean"));
}

// The same signals, once as the simulated finger's and once as a real one's.
TEST_F(Training, RandomPlatesBesideARealFingerAreFeltByOtherFingers) {
  fs::create_directories(path("real"));
  for (const std::string& file : list_recordings(path("data"))) {
    Recording pass = read_recording(file);
    pass.source = "imported";
    write_recording(path("real/" + recording_file_name(pass)), pass);
  }
  const auto weights = [](const std::string& name, const std::string& more) {
    trained(name + ".safetensors", "--epochs 1 --data " + more);
    return SafetensorsFile::read(path(name + ".safetensors")).f32("upsampler.fc.weight");
  };
  EXPECT_EQ(weights("one", "data"), weights("another", "real"));
  EXPECT_NE(weights("own", "data --random-plates 5"), weights("other", "real --random-plates 5"));
}

// Whoever links the library trains what the program trains.
TEST_F(Training, TheExampleEndsWithTheProgramsHash) {
  succeed("supertac-train --data data --out program.safetensors --preset tiny --epochs 1 --stride 64");
  const ProcessResult example = succeed(SUPERTAC_TRAIN_EXAMPLE " data example.safetensors 1 64");
  EXPECT_TRUE(
      contains(example.out, "content " + content_hash(SafetensorsFile::read(path("program.safetensors")))));
}

TEST_F(Training, LikeRepeatsATrainingToTheSameContent) {
  trained(
      "first.safetensors",
      "--optimizer muon --seed 7 --split pass --stride 128 --epochs 1 --random-plates 2 --interval-factor "
      "1.5");
  const std::string like = "supertac-train --data data --recipe-of first.safetensors --out ";
  succeed(like + "again.safetensors");
  EXPECT_EQ(content_hash(SafetensorsFile::read(path("first.safetensors"))),
            content_hash(SafetensorsFile::read(path("again.safetensors"))));
  const SafetensorsFile file = SafetensorsFile::read(path("again.safetensors"));
  EXPECT_TRUE(contains(file.metadata().at("training"), "\"optimizer\":\"muon\""));
  succeed(like + "seed8.safetensors --seed 8");
  EXPECT_NE(content_hash(SafetensorsFile::read(path("first.safetensors"))),
            content_hash(SafetensorsFile::read(path("seed8.safetensors"))));
  expect_exit(run(like + "no.safetensors --preset tiny"), 2,
              "expected --preset NAME or --recipe-of MODEL, found both");
}

TEST_F(Training, EvaluationWritesTheAgreedJsonAndOutputs) {
  trained("scored.safetensors");
  const std::string page = bytes("scored.run/report.html");
  EXPECT_TRUE(contains(page, "\"log\":\"time_s,step,total,"));
  for (const char* outside : {"http://", "https://", "<!--", "{{"}) EXPECT_FALSE(contains(page, outside));
  succeed(
      "supertac-evaluate --model scored.safetensors --data data --json scores.json --outputs "
      "outputs.safetensors --limit 40 --pictures pictures --map maps.safetensors");
  const auto scores = json("scores.json");
  for (const auto* of : {&scores, &scores["baselines"]["mean_image"], &scores["baselines"]["bicubic"]}) {
    for (const char* part : {"all", "contact"}) {
      for (const char* key : {"windows", "psnr_mean_db", "psnr_pooled_db", "ssim", "phase_correlation",
                              "phase_correlation_floor", "position_error_px", "position_error_mm"}) {
        EXPECT_TRUE((*of)[part].contains(key)) << part << " " << key;
      }
    }
  }
  for (const char* part : {"flat", "air"}) EXPECT_TRUE(scores[part].contains("ghost_rate")) << part;
  EXPECT_TRUE(scores["contact"].contains("miss_rate"));
  for (const char* key :
       {"interval", "coverage", "interval_found", "coverage_of", "auroc", "unlike_training"})
    EXPECT_TRUE(scores["trust"].contains(key)) << key;
  const SafetensorsFile outputs = SafetensorsFile::read(path("outputs.safetensors"));
  EXPECT_EQ(outputs.tensors().at("input").shape, (std::vector<std::uint64_t>{40, 32, 16}));
  EXPECT_EQ(outputs.tensors().at("output").shape, (std::vector<std::uint64_t>{40, 8, 8}));
  EXPECT_EQ(outputs.tensors().at("predicted_error").shape, (std::vector<std::uint64_t>{40, 8, 8}));
  const std::vector<float> drawn = outputs.f32("output"), truths = outputs.f32("truth"),
                           predicted = outputs.f32("predicted_error");
  std::vector<double> good, bad;  // predicted errors of pictures in contact
  for (std::size_t n = 0; n < 40; ++n) {
    const auto of = [n](const std::vector<float>& all) { return std::span(all).subspan(64 * n, 64); };
    const auto errors = of(predicted);
    if (std::ranges::all_of(of(truths), [](float v) { return v == 0; })) continue;
    (ssim(of(drawn), of(truths), 8, 8) < 0.8 ? bad : good)
        .push_back(std::accumulate(errors.begin(), errors.end(), 0.0));
  }
  double told = 0;
  for (const double error : bad)
    told += static_cast<double>(std::ranges::count_if(good, [&](double e) { return error > e; }));
  const double pairs = static_cast<double>(good.size() * bad.size());
  EXPECT_EQ(scores["trust"]["auroc"].is_number(), pairs > 0);
  if (pairs > 0) {
    EXPECT_NEAR(scores["trust"]["auroc"].get<double>(), told / pairs, 1e-9);
  }
  EXPECT_EQ(outputs.tensors().at("position_mm").shape, (std::vector<std::uint64_t>{40, 2}));
  EXPECT_EQ(outputs.tensors().at("pass").dtype, "I64");
  EXPECT_TRUE(fs::exists(path("pictures/strips.png")));
  const SafetensorsFile maps = SafetensorsFile::read(path("maps.safetensors"));
  for (const auto& [name, tensor] : maps.tensors()) {
    const std::size_t at = name.rfind("_p");
    if (!name.ends_with(".values") || at == std::string::npos) continue;
    EXPECT_TRUE(maps.tensors().contains(name.substr(0, at) + ".truth")) << name;
  }
  EXPECT_GE(maps.tensors().size(), 6U);
  for (const char* of : {"of_pass", "of_surface"}) EXPECT_GT(scores["map"][of]["psnr_mean_db"], 5) << of;
  EXPECT_TRUE(scores["map"]["surfaces"].begin()->contains("pitch_mm"));
  double ssim = 0, windows = 0;  // over passes as over windows
  for (const auto& pass : scores["over_passes"]["passes"]) {
    ssim += pass["ssim"].get<double>() * pass["windows"].get<double>();
    windows += pass["windows"].get<double>();
  }
  EXPECT_NEAR(ssim / windows, scores["contact"]["ssim"], 1e-9);
}

TEST_F(Training, BadInputIsOneLineAndLeavesNothingBehind) {
  trained("good.safetensors");
  std::string damaged = bytes("good.safetensors");
  damaged[damaged.size() / 2] ^= 1;
  write_file(path("damaged.safetensors"), damaged);
  write_file(path("cut.safetensors"), std::string_view(damaged).substr(0, 1000));
  fs::create_directories(path("empty"));
  struct Bad {
    std::string line;
    int code;
    std::string message;
  };
  const std::string train = "supertac-train --data data --out never.safetensors ",
                    evaluate = "supertac-evaluate --data data --model ";
  for (const auto& [line, code, message] : std::vector<Bad>{
           {train + "--timesteps 40", 2, "multiple of 16"},
           {train + "--timesteps 1024", 2, "--timesteps"},
           {train + "--scale 3", 2, "--scale"},
           {train + "--preset huge", 2, "--preset"},
           {train + "--epoch 3", 2, "--epochs"},
           {train + "--split texture", 1, "texture"},
           {train + "--data " + path("empty"), 1, path("empty")},
           {train + "--data " + path("absent"), 1, path("absent")},
           {train + "--out good.safetensors", 1, "--force"},
           {train + "--out good.safetensors --resume good.run/last.safetensors", 1, "exists already"},
           {train + "--out " + path("absent/x.safetensors"), 1, path("absent")},
           {train + "--plates 6_Bumps", 1, "6_Bumps"},
           {train + "--leave-out 3_Bumps", 2, "--split texture"},
           {train + "--resume good.safetensors", 1, "cannot resume"},
           {evaluate + "damaged.safetensors", 1, "damaged.safetensors"},
           {evaluate + "cut.safetensors", 1, "cut.safetensors"},
           {evaluate + "absent", 1, "absent"},
           {"supertac-evaluate --model good.safetensors", 2, "--data"}}) {
    SCOPED_TRACE(line);
    expect_failure(run(line), code, message);
  }
  EXPECT_FALSE(fs::exists(path("never.safetensors")));
  EXPECT_FALSE(fs::exists(path("never.run")));
  EXPECT_EQ(bytes("damaged.safetensors"), damaged);
}

// On a terminal the bar has epoch, loss and SSIM of the test side.
TEST_F(Training, TheBarShowsEpochLossAndTestSsim) {
  const ProcessResult made =
      succeed("supertac-train" + options("shown.safetensors", "--epochs 500 --batch 64"), {.terminal = true});
  EXPECT_TRUE(std::regex_search(
      made.error,
      std::regex(
          R"(training  \[#+\.*\]  \d+ %  epoch \d+/500 loss \d*\.\d+ test SSIM -?\d*\.\d+  \d+:\d\d left)")))
      << made.error;
}

using SeveralModels = Training;

TEST_F(SeveralModels, AreAveragedUnlessTheySawEachOthersTest) {
  const std::string one = "one.safetensors", two = "two.safetensors", all = "all.safetensors";
  const std::string evaluate = "supertac-evaluate --data data --limit 20 --model ";
  trained(one, "--seed 1 --split pass");
  trained(two, "--seed 2 --split pass");
  trained(all, "--split none");
  expect_exit(run(evaluate + one + "," + two), 1, "with split pass (seed 1), another with pass (seed 2)");
  expect_exit(run(evaluate + one + "," + all), 1, "split pass (seed 1), another with none");
  succeed(evaluate + one + "," + all + " --split none");
  EXPECT_TRUE(contains(run(evaluate + all).error, "it has seen every one of them"));

  const auto ssim = [&](const std::string& models) {
    const ProcessResult result =
        succeed(evaluate + models + " --split trial --limit 60 --json average.json --force");
    EXPECT_TRUE(contains(result.error, "tested is split trial: if these are the recordings of its training"));
    return json("average.json")["all"]["ssim"].get<double>();
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
              "texture (leaving out 6_Bumps), another with texture (leaving out 6_Ridges)");
}

}  // namespace supertac::training_test
