// Another sensor from simulation to scores: nothing but the recordings says what it is.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "data/recordings/recording.h"
#include "io/files/file.h"
#include "io/files/safetensors.h"
#include "io/numbers/numbers.h"
#include "io/numbers/sha256.h"
#include "models/files/model_file.h"
#include "tests/apps/common/process.h"

namespace supertac {
namespace {

void simulate(const std::string& out, const std::vector<std::string>& array) {
  std::vector<std::string> arguments = {"--out", out,        "--plates", "bumps12",  "--speeds",
                                        "10",    "--passes", "1",        "--trials", "2"};
  arguments.insert(arguments.end(), array.begin(), array.end());
  const auto done = run_process("supertac-simulate", arguments);
  ASSERT_EQ(done.code, 0) << done.error;
}

void train(const std::string& data, const std::string& model) {
  const auto done =
      run_process("supertac-train", {"--data", data, "--out", model, "--preset", "tiny", "--timesteps", "32",
                                     "--epochs", "1", "--stride", "40", "--batch", "8"});
  ASSERT_EQ(done.code, 0) << done.error;
}

nlohmann::json evaluate(const TemporaryFolder& folder, const std::string& data, const std::string& model) {
  const std::string json = folder / "scores.json", outputs = folder / "outputs.safetensors";
  const auto done =
      run_process("supertac-evaluate", {"--data", data, "--model", model, "--limit", "40", "--json", json,
                                        "--outputs", outputs, "--pictures", folder / "pictures"});
  EXPECT_EQ(done.code, 0) << done.error;
  return nlohmann::json::parse(read_text_file(json, 1 << 20));
}

TEST(Array, SixBySixFromSimulationToScores) {
  const TemporaryFolder folder;
  const std::string data = folder / "data", model = folder / "m.safetensors";
  simulate(data, {"--array", "6x6", "--pitch", "2"});
  train(data, model);
  const auto scores = evaluate(folder, data, model);
  EXPECT_EQ(scores.at("all").at("windows"), 40);
  EXPECT_TRUE(scores.at("baselines").at("ridge").at("all").at("ssim").is_number());
  EXPECT_GT(scores.at("latency").at("ridge").at("median_us"), 0);
  double windows = 0, ssim = 0;  // by how much was felt: the parts make up the whole
  for (const auto& part : scores.at("felt")) {
    windows += part.at("windows").get<double>();
    ssim += part.at("windows").get<double>() * part.at("ssim").get<double>();
  }
  EXPECT_GT(scores.at("felt").size(), 1U);
  EXPECT_EQ(windows, scores.at("contact").at("windows"));
  EXPECT_NEAR(ssim / windows, scores.at("contact").at("ssim").get<double>(), 1e-9);
  const SafetensorsFile outputs = SafetensorsFile::read(folder / "outputs.safetensors");
  EXPECT_EQ(outputs.tensors().at("input").shape, (std::vector<std::uint64_t>{40, 32, 36}));
  EXPECT_EQ(outputs.tensors().at("output").shape, (std::vector<std::uint64_t>{40, 24, 24}));

  simulate(folder / "rig", {});
  const auto mismatch = run_process("supertac-evaluate", {"--data", folder / "rig", "--model", model});
  EXPECT_EQ(mismatch.code, 1);
  EXPECT_NE(
      mismatch.error.find("bumps12_t1_p1_v10.safetensors: was recorded with 4x4 taxels at 3 mm, expected 6x6 "
                          "taxels at 2 mm; give recordings of the array the model is for, and no others\n"),
      std::string::npos)
      << mismatch.error;
}

// What is drawn means nothing.
void write_model(const std::string& path, const TaxelArray& array, Dim timesteps, Dim scale) {
  SuperTacSettings settings{.timesteps = timesteps, .latent = 3, .scale = scale, .channels = 8, .rcabs = 1};
  set_array(settings, array);
  Rng rng(1);
  save_model(path, SuperTac(settings, rng),
             {.scaling = {}, .filter_s = std::nullopt, .pitch_mm = array.pitch_mm}, {{"split", "none"}});
}

// The ridge of a large array says how long it takes, and hears Ctrl-C.
TEST(Array, ASignalEndsTheFitOfTheBaselines) {
  const TemporaryFolder folder;
  simulate(folder / "data", {"--array", "16x16", "--pitch", "2"});
  write_model(folder / "m.safetensors", {.rows = 16, .columns = 16, .pitch_mm = 2}, 32, 4);
  const std::string said = folder / "said";
  RunningProcess running("/bin/sh",
                         {"-c", "exec \"$@\" 2>" + said, "sh", SUPERTAC_BIN "/supertac-evaluate", "--data",
                          folder / "data", "--model", folder / "m.safetensors", "--split", "none"});
  const auto heard = [&] {
    return std::filesystem::exists(said) &&
           read_text_file(said, 1 << 20).find("fitting the baselines: about ") != std::string::npos;
  };
  for (int i = 0; i < 4000 && !heard() && !running.ended(); ++i) usleep(50'000);
  ASSERT_TRUE(heard()) << read_text_file(said, 1 << 20);
  running.send(SIGINT);
  EXPECT_EQ(running.wait().code, 130) << read_text_file(said, 1 << 20);
}

// Three numbers a taxel, as a magnetic sensor gives, on an array that is no square.
TEST(Array, ThreeChannelsOfTwoBySix) {
  const TemporaryFolder folder;
  const std::string data = folder / "data", model = folder / "m.safetensors";
  simulate(data, {"--array", "2x6", "--pitch", "2.5"});
  for (const std::string& path : list_recordings(data)) {
    Recording recording = read_recording(path);
    const std::vector<float> one = recording.volts;
    recording.array.channels = 3;
    recording.volts.clear();
    for (const float v : one) recording.volts.insert(recording.volts.end(), {v, 0.5F * v + 1.2F, 2.4F});
    write_recording(path, recording);
  }
  train(data, model);
  const auto scores = evaluate(folder, data, model);
  EXPECT_TRUE(scores.at("all").at("ssim").is_number());
  const SafetensorsFile outputs = SafetensorsFile::read(folder / "outputs.safetensors");
  EXPECT_EQ(outputs.tensors().at("input").shape, (std::vector<std::uint64_t>{40, 32, 36}));
  EXPECT_EQ(outputs.tensors().at("output").shape, (std::vector<std::uint64_t>{40, 8, 24}));
}

// Signals from 68 to 102 would all be clipped to nothing by the rig's range.
TEST(Array, SignalsOfAnotherRangeAreNoticed) {
  const TemporaryFolder folder;
  const std::string data = folder / "data", model = folder / "m.safetensors";
  simulate(data, {"--array", "3x5", "--pitch", "2.5"});
  for (const std::string& path : list_recordings(data)) {
    Recording recording = read_recording(path);
    for (float& v : recording.volts) v = 100 - (2.45F - v) / 0.36F * 35;
    write_recording(path, recording);
  }
  const std::vector<std::string> brief = {"--data", data,       "--out", model,      "--preset",
                                          "tiny",   "--epochs", "1",     "--stride", "64"};
  const auto with = [&](const char* option, const char* value) {
    std::vector<std::string> arguments = brief;
    arguments.insert(arguments.end(), {option, value});
    return run_process("supertac-train", arguments);
  };
  const auto refused = with("--range", "2.45,0.36");
  EXPECT_EQ(refused.code, 1);
  EXPECT_NE(refused.error.find("--range 2.45,0.36 clips 100.0 % of the signals, which lie at "),
            std::string::npos)
      << refused.error;
  const auto random = with("--random-plates", "5");
  EXPECT_EQ(random.code, 1);
  EXPECT_NE(random.error.find("--random-plates imitates a sensor whose signals rest at"), std::string::npos)
      << random.error;
  const auto found = with("--seed", "1");
  EXPECT_EQ(found.code, 0) << found.error;
  const ModelFile file = load_model(model);
  EXPECT_NEAR(file.input.scaling.rest_volts, 100, 3);
  EXPECT_NEAR(file.input.scaling.span_volts, 30, 15);
}

TEST(Array, RefusesWhatIsNoArray) {
  const TemporaryFolder folder;
  for (const char* array : {"6", "6x", "x6", "0x6", "6x65", "6x6x3", "4,4"}) {
    const auto done = run_process("supertac-simulate", {"--out", folder / "data", "--array", array});
    EXPECT_EQ(done.code, 2) << array;
    EXPECT_NE(done.error.find(std::string("--array expects ROWSxCOLUMNS, 1 to 64 each, found ") + array),
              std::string::npos)
        << done.error;
  }
}

TEST(Array, WindowsOf64RowsAreTrainedAndKept) {
  const TemporaryFolder folder;
  const std::string data = folder / "data", model = folder / "m.safetensors";
  ASSERT_EQ(run_process("supertac-simulate", {"--out", data, "--array", "64x1", "--pitch", "1", "--plates",
                                              "ridges6", "--speeds", "20", "--trials", "1", "--passes", "1"})
                .code,
            0);
  const auto trained =
      run_process("supertac-train", {"--data", data, "--out", model, "--preset", "tiny", "--timesteps", "32",
                                     "--epochs", "1", "--stride", "64", "--split", "none"});
  ASSERT_EQ(trained.code, 0) << trained.error;
  EXPECT_EQ(load_model(model).model->settings().groups(), 64);
}

TEST(Array, IsSimulatedAsASensorsFileSays) {
  const TemporaryFolder folder;
  write_file(folder / "mat.json",
             std::string(R"({"name": "mat", "rows": 4, "columns": 6, "pitch_mm": [4, 2.5], "unit": "counts",
                             "pressed": "higher", "range": [40, 900], "rate_hz": 100, "frame": {"kind": "text"}})"));
  const std::vector<std::string> common = {
      "--plates", "3_Bumps",  "--speeds", "10",       "--trials",
      "2",        "--passes", "1",        "--sensor", folder / "mat.json"};
  std::vector<std::string> words = common;
  words.insert(words.end(), {"--out", folder / "sim"});
  const auto made = run_process("supertac-simulate", words);
  ASSERT_EQ(made.code, 0) << made.error;
  const Recording recording = read_recording(list_recordings(folder / "sim").front());
  EXPECT_EQ(recording.array, (TaxelArray{.rows = 4, .columns = 6, .pitch_mm = {4, 2.5}}));
  EXPECT_EQ(recording.signal_scale, (SignalScale{.unit = "counts", .rest = 40, .span = -860}));
  EXPECT_NEAR(recording.time_s[1] - recording.time_s[0], 0.01, 1e-9);
  const auto [low, high] = std::ranges::minmax(recording.volts);
  EXPECT_GT(low, 0);
  EXPECT_GT(high, 300);
  EXPECT_LT(high, 910);
  train(folder / "sim", folder / "m.safetensors");
  EXPECT_EQ(load_model(folder / "m.safetensors").array(), recording.array);
  EXPECT_TRUE(evaluate(folder, folder / "sim", folder / "m.safetensors").at("all").at("ssim").is_number());
  words.insert(words.end(), {"--array", "4x4"});
  EXPECT_EQ(run_process("supertac-simulate", words).code, 2);
}

// A log that another program kept: milliseconds, positions, names, a file for every second or so.
TEST(Array, AHundredTablesAreImportedTrainedAndScored) {
  const TemporaryFolder folder;
  const std::string sensor = folder / "mat.json", model = folder / "m.safetensors";
  write_file(sensor, std::string(R"({"name": "mat", "rows": 4, "columns": 4, "pitch_mm": 3, "unit": "counts",
                                     "pressed": "higher", "range": [40, 900], "rate_hz": 100,
                                     "frame": {"kind": "text"}})"));
  const auto made =
      run_process("supertac-simulate", {"--plates", "ridges6", "--speeds", "10", "--trials", "1", "--passes",
                                        "5", "--sensor", sensor, "--out", folder / "sim"});
  ASSERT_EQ(made.code, 0) << made.error;
  int tables = 0;
  for (const std::string& path : list_recordings(folder / "sim")) {
    const Recording r = read_recording(path);
    const std::string day = folder / "log/day" + std::to_string(r.pass % 5 + 1);
    make_directories(day);
    for (std::size_t part = 0; part < 20; ++part) {
      std::string text = "ms;x;y;";
      for (int k = 0; k < 16; ++k) text += "taxel" + std::to_string(k) + (k < 15 ? ";" : "\n");
      for (std::size_t i = part * r.frames() / 20; i < (part + 1) * r.frames() / 20; ++i) {
        text += format(1e3 * r.time_s[i]) + ";" + format(r.position_mm[2 * i]) + ";" +
                format(r.position_mm[2 * i + 1]);
        for (std::size_t k = 0; k < 16; ++k) text += ";" + format(r.volts[16 * i + k]);
        text += "\n";
      }
      write_file(day + "/" + std::to_string(r.pass) + "_" + std::to_string(part) + ".csv", text);
      ++tables;
    }
  }
  ASSERT_EQ(tables, 100);
  const std::string data = folder / "data";
  const auto imported = run_process(
      "supertac-import", {folder / "log", "--sensor", sensor, "--columns",
                          "time=ms:ms,x=x,y=y,values=taxel0-taxel15", "--plate", "ridges6", "--out", data});
  ASSERT_EQ(imported.code, 0) << imported.error;
  EXPECT_NE(imported.out.find("100 recordings in"), std::string::npos);
  const Recording first = read_recording(data + "/ridges6_t1_p1_v0.safetensors");
  EXPECT_EQ(first.metadata.at("group"), "day1");
  const auto trained =
      run_process("supertac-train", {"--data", data, "--out", model, "--preset", "tiny", "--timesteps", "32",
                                     "--epochs", "1", "--stride", "8", "--batch", "8", "--split", "group"});
  ASSERT_EQ(trained.code, 0) << trained.error;
  EXPECT_EQ(evaluate(folder, data, model).at("all").at("windows"), 40);

  const auto refusal_of = [&](const std::string& columns) {
    return run_process("supertac-import", {folder / "log/day1", "--sensor", sensor, "--columns", columns,
                                           "--plate", "ridges6", "--out", folder / "refused"})
        .error;
  };
  EXPECT_NE(refusal_of("time=ms:ms,x=y,y=x,values=taxel0-taxel15").find("are x and y exchanged?"),
            std::string::npos);
  write_file(folder / "metres.csv", std::string("time,x,y\n0,0.018,0.02\n100000,0.018,0.08\n"));
  const auto metres =
      run_process("supertac-import",
                  {folder / "log/day1", "--sensor", sensor, "--columns", "time=ms:ms,values=taxel0-taxel15",
                   "--positions", folder / "metres.csv", "--plate", "ridges6", "--out", folder / "refused"});
  EXPECT_NE(metres.error.find("are these metres?"), std::string::npos) << metres.error;

  write_file(folder / "log/day1/odd.csv", std::string("not a table\n"));
  std::vector<std::string> again = {folder / "log", "--sensor", sensor,  "--columns",    "time=ms:ms,x=x,y=y",
                                    "--plate",      "ridges6",  "--out", folder / "more"};
  const auto refused = run_process("supertac-import", again);
  EXPECT_EQ(refused.code, 1);
  EXPECT_NE(refused.error.find("odd.csv: holds no line of numbers"), std::string::npos) << refused.error;
  again.emplace_back("--skip-bad");
  EXPECT_EQ(run_process("supertac-import", again).code, 0);
  again = {folder / "log", "--out", folder / "none", "--columns", "time=ms"};
  EXPECT_EQ(run_process("supertac-import", again).code, 2);
}

// A person slides the mat over a known plate: nothing says where it was but what it felt.
TEST(Array, ATableWithoutPositionsIsRegisteredAgainstItsPlate) {
  const TemporaryFolder folder;
  const std::string sensor = folder / "mat.json";
  write_file(sensor,
             std::string(R"({"name": "mat", "rows": 6, "columns": 6, "pitch_mm": 2.5, "unit": "counts",
                                     "pressed": "higher", "range": [40, 900], "rate_hz": 100,
                                     "frame": {"kind": "text"}})"));
  const auto made =
      run_process("supertac-simulate", {"--plates", "3_Bumps", "--speeds", "12", "--trials", "1", "--passes",
                                        "1", "--sensor", sensor, "--out", folder / "sim"});
  ASSERT_EQ(made.code, 0) << made.error;
  const Recording truth = read_recording(list_recordings(folder / "sim").front());
  std::string text;
  for (std::size_t i = 0; i < truth.frames(); ++i)
    for (std::size_t k = 0; k < 36; ++k) text += format(truth.volts[36 * i + k]) + (k < 35 ? " " : "\n");
  write_file(folder / "slide.txt", text);
  const auto done = run_process("supertac-import", {folder / "slide.txt", "--sensor", sensor, "--plate",
                                                    "3_Bumps", "--speed", "12", "--out", folder / "data"});
  ASSERT_EQ(done.code, 0) << done.error;
  EXPECT_NE(done.out.find("positions found, residual"), std::string::npos) << done.out;
  const Recording found = read_recording(list_recordings(folder / "data").front());
  EXPECT_EQ(found.metadata.at("registration_reliable"), "yes");
  for (std::size_t i = 0; i < truth.frames(); ++i)
    if (const double y = truth.position_mm[2 * i + 1]; y > 30 && y < 80 && truth.lift_mm[i] == 0) {
      EXPECT_NEAR(found.position_mm[2 * i + 1], y, 0.6) << i;
    }

  // The same from what supertac-stream --record would have kept.
  Recording kept = truth;
  kept.position_mm.clear(), kept.lift_mm.clear();
  write_recording(folder / "kept.safetensors", kept);
  const auto again =
      run_process("supertac-import", {folder / "kept.safetensors", "--sensor", sensor, "--plate", "3_Bumps",
                                      "--speed", "12", "--out", folder / "again"});
  ASSERT_EQ(again.code, 0) << again.error;
  EXPECT_EQ(read_recording(list_recordings(folder / "again").front()).position_mm, found.position_mm);
  // It names its plate: that is enough, and another plate a contradiction.
  std::vector<std::string> named{
      folder / "kept.safetensors", "--sensor", sensor, "--speed", "12", "--out", folder / "named"};
  EXPECT_EQ(run_process("supertac-import", named).code, 0);
  EXPECT_EQ(read_recording(list_recordings(folder / "named").front()).position_mm, found.position_mm);
  named.insert(named.end(), {"--plate", "6_Bumps"});
  EXPECT_NE(
      run_process("supertac-import", named).error.find("was recorded over 3_Bumps, --plate says 6_Bumps"),
      std::string::npos);
  const auto nowhere =
      run_process("supertac-import", {folder / "slide.txt", "--sensor", sensor, "--out", folder / "nowhere"});
  EXPECT_NE(nowhere.out.find(" s, no positions: name its plate (--plate)"), std::string::npos) << nowhere.out;
}

// Tables of two days have the same names; what stands beside them is in folders of theirs.
TEST(Array, CompanionsBelongToTheirOwnTable) {
  const TemporaryFolder folder;
  const std::string sensor = folder / "mat.json";
  write_file(sensor, std::string(R"({"name": "mat", "rows": 2, "columns": 2, "pitch_mm": 3, "unit": "counts",
                                     "pressed": "higher", "range": [0, 100], "rate_hz": 100,
                                     "frame": {"kind": "text"}})"));
  std::string frames;
  for (int i = 0; i < 50; ++i) frames += "1,2,3,4\n";
  for (const int day : {1, 2}) {
    const std::string name = "day" + std::to_string(day);
    make_directories(folder / ("log/" + name)), make_directories(folder / ("stage/" + name));
    write_file(folder / ("log/" + name + "/1.csv"), frames + std::to_string(day) + ",2,3,4\n");
    write_file(folder / ("stage/" + name + "/1.csv"),
               "0,0," + std::to_string(10 * day) + "\n1,0," + std::to_string(10 * day) + "\n");
  }
  const std::vector<std::string> words = {folder / "log",   "--sensor", sensor,         "--positions",
                                          folder / "stage", "--out",    folder / "data"};
  const auto done = run_process("supertac-import", words);
  ASSERT_EQ(done.code, 0) << done.error;
  for (const std::string& path : list_recordings(folder / "data")) {
    const Recording r = read_recording(path);
    const std::string day = r.metadata.at("group");
    EXPECT_EQ(r.position_mm[1], day == "day1" ? 10.0F : 20.0F);
    Sha256 hash;
    hash.add(read_text_file(folder / ("log/" + day + "/1.csv"), 1 << 20));
    const auto made = nlohmann::json::parse(SafetensorsFile::read(path).metadata().at("provenance"));
    EXPECT_EQ(made["parents"]["table"], hash.hex());
  }
  write_file(folder / "stage/day1/1.txt", std::string("0,0,1\n1,0,1\n"));
  auto again = words;
  again.back() = folder / "more";
  EXPECT_NE(run_process("supertac-import", again).error.find("holds two tables of the name 1"),
            std::string::npos);

  Recording elsewhere = read_recording(list_recordings(folder / "data").front());
  elsewhere.plate = "../unknown";
  write_recording(folder / "elsewhere.safetensors", elsewhere);
  const auto refused = run_process(
      "supertac-import", {folder / "elsewhere.safetensors", "--sensor", sensor, "--out", folder / "none"});
  EXPECT_EQ(refused.code, 1);
  EXPECT_NE(refused.error.find("expected a plate's name without '/'"), std::string::npos) << refused.error;
  EXPECT_EQ(run_process("supertac-import", {folder / "log", "--sensor", sensor, "--truth-range", "5,5",
                                            "--out", folder / "none"})
                .code,
            2);
}

}  // namespace
}  // namespace supertac
