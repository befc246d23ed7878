// Another sensor from simulation to scores: nothing but the recordings says what it is.
#include <unistd.h>

#include <csignal>
#include <nlohmann/json.hpp>

#include "data/recordings/recording.h"
#include "data/windows/windows.h"
#include "io/files/file.h"
#include "io/files/safetensors.h"
#include "io/numbers/hash.h"
#include "io/numbers/numbers.h"
#include "models/files/model_file.h"
#include "tests/apps/common/expect.h"
#include "tests/data/test_recordings.h"
#include "tests/support/test.h"

namespace supertac::array_test {

class Array : public ProgramTest {
 protected:
  // Two passes of the rig, or of the sensor that a file describes.
  void simulate(const std::string& more) const {
    succeed("supertac-simulate --out data --plates bumps12 --speeds 10 --passes 1 --trials 2 " + more);
  }
  // Two passes of such an array on the rig's dome, with its signals.
  void simulate(int rows, int columns, const std::string& pitch_mm) const {
    describe(
        rows, columns, pitch_mm,
        R"("V", "pressed": "lower", "range": [2.09, 2.45], "rate_hz": 1008, "body": {"shape": "dome", "radius_mm": 47})");
    simulate("--sensor mat.json");
  }
  // Of the passes in path("data"), in seconds; an option that is given again replaces the one before.
  void train(const std::string& more = "") const {
    succeed(
        "supertac-train --data data --out m.safetensors --preset tiny --timesteps 32 --epochs 1 --stride 40 "
        "--batch 8 " +
        more);
  }
  nlohmann::json evaluate() const {
    succeed(
        "supertac-evaluate --data data --model m.safetensors --limit 40 --json scores.json --outputs "
        "outputs.safetensors --pictures pictures");
    return json("scores.json");
  }
  // The file of a sensor.
  static void describe(int rows, int columns, const std::string& pitch_mm, const std::string& unit_and_more) {
    write_file(path("mat.json"), R"({"name": "mat", "rows": )" + std::to_string(rows) + R"(, "columns": )" +
                                     std::to_string(columns) + R"(, "pitch_mm": )" + pitch_mm +
                                     R"(, "frame": {"kind": "text"}, "unit": )" + unit_and_more + "}");
  }
  static void write_mat(int rows, int columns, const std::string& pitch_mm,
                        const std::string& range = "[40, 900]") {
    describe(rows, columns, pitch_mm, R"("counts", "pressed": "higher", "rate_hz": 100, "range": )" + range);
  }
  Recording first_of(const std::string& data) const {
    return read_recording(list_recordings(path(data)).front());
  }
};

TEST_F(Array, SixBySixFromSimulationToScores) {
  simulate(6, 6, "2");
  train();
  const auto scores = evaluate();
  EXPECT_EQ(scores.at("all").at("windows"), 40);
  EXPECT_TRUE(scores.at("baselines").at("ridge").at("all").at("ssim").is_number());
  EXPECT_GT(scores.at("latency").at("ridge").at("median_us"), 0);
  double windows = 0, ssim = 0;  // by how much was felt: the parts make up the whole
  for (const auto& part : scores.at("by_distance")) {
    windows += part.at("windows").get<double>();
    ssim += part.at("windows").get<double>() * part.at("ssim").get<double>();
  }
  EXPECT_GT(scores.at("by_distance").size(), 1U);
  EXPECT_EQ(windows, scores.at("contact").at("windows"));
  EXPECT_NEAR(ssim / windows, scores.at("contact").at("ssim").get<double>(), 1e-9);
  const SafetensorsFile outputs = SafetensorsFile::read(path("outputs.safetensors"));
  EXPECT_EQ(outputs.tensors().at("input").shape, (std::vector<std::uint64_t>{40, 32, 36}));
  EXPECT_EQ(outputs.tensors().at("output").shape, (std::vector<std::uint64_t>{40, 24, 24}));

  simulate("--force");  // the rig's
  expect_exit(run("supertac-evaluate --data data --model m.safetensors"), 1,
              "bumps12_t1_p1_v10.safetensors: was recorded with 4x4 taxels at 3 mm, expected 6x6 "
              "taxels at 2 mm; give recordings of the array the model is for, and no others\n");
}

// What is drawn means nothing.
void write_model(const std::string& path, const TaxelArray& array, Dim timesteps, Dim scale) {
  SuperTacSettings settings{.timesteps = timesteps, .latent = 3, .scale = scale, .channels = 8, .rcabs = 1};
  set_array(settings, array);
  Rng rng(1);
  save_model(path, SuperTac(settings, rng),
             {.scaling = {}, .filter_s = std::nullopt, .pitch_mm = array.pitch_mm}, {{"split", "none"}});
}

// The ridge of a large array takes a minute and hears Ctrl-C; what comes before it is done in two seconds.
TEST_F(Array, ASignalEndsTheFitOfTheBaselines) {
  simulate(16, 16, "2");
  write_model(path("m.safetensors"), {.rows = 16, .columns = 16, .pitch_mm = 2}, 32, 4);
  RunningProcess running = start("supertac-evaluate --data data --model m.safetensors --split none");
  for (int i = 0; i < 80 && !running.ended(); ++i) usleep(50'000);
  ASSERT_FALSE(running.ended());
  running.send(SIGINT);
  const ProcessResult result = running.wait();
  EXPECT_EQ(result.code, 130) << result.error;
}

// Signals from 68 to 102 would all be clipped to nothing by the rig's range.
TEST_F(Array, SignalsOfAnotherRangeAreNoticed) {
  simulate(3, 5, "2.5");
  for (const std::string& file : list_recordings(path("data"))) {
    Recording recording = read_recording(file);
    for (float& v : recording.signals) v = 100 - (2.45F - v) / 0.36F * 35;
    write_recording(file, recording);
  }
  const std::string brief =
      "supertac-train --data data --out m.safetensors --preset tiny --epochs 1 --stride 64 ";
  expect_exit(run(brief + "--range 2.45,0.36"), 1,
              "--range 2.45,0.36 clips 100.0 % of the signals, which lie at ");
  expect_exit(run(brief + "--random-plates 5"), 1, "--random-plates imitates a sensor whose signals rest at");
  succeed(brief);
  const ModelFile file = load_model(path("m.safetensors"));
  EXPECT_NEAR(file.input.scaling.rest, 100, 3);
  EXPECT_NEAR(file.input.scaling.span, 30, 15);
}

TEST_F(Array, WindowsOf64RowsAreTrainedAndKept) {
  write_mat(64, 1, "1");
  simulate("--sensor mat.json --plates ridges6 --speeds 20 --trials 1");
  train("--stride 64 --split none");
  EXPECT_EQ(load_model(path("m.safetensors")).model->settings().groups(), 64);
}

TEST_F(Array, IsSimulatedAsASensorsFileSays) {
  write_mat(4, 6, "[4, 2.5]");
  simulate("--plates 3_Bumps --sensor mat.json");
  const Recording recording = first_of("data");
  EXPECT_EQ(recording.array, (TaxelArray{.rows = 4, .columns = 6, .pitch_mm = {4, 2.5}}));
  EXPECT_EQ(recording.signal_scale, (SignalScale{.unit = "counts", .rest = 40, .span = -860}));
  EXPECT_NEAR(recording.time_s[1] - recording.time_s[0], 0.01, 1e-9);
  const auto [low, high] = std::ranges::minmax(recording.signals);
  EXPECT_GT(low, 0);
  EXPECT_GT(high, 300);
  EXPECT_LT(high, 910);
}

// A log that another program kept: milliseconds, positions, names, a file for every second or so.
TEST_F(Array, AHundredTablesAreImportedTrainedAndScored) {
  write_mat(4, 4, "3");
  succeed("supertac-simulate --plates ridges6 --speeds 10 --trials 1 --passes 5 --sensor mat.json --out sim");
  int tables = 0;
  for (const std::string& file : list_recordings(path("sim"))) {
    const Recording r = read_recording(file);
    const std::string day = path("log/day") + std::to_string(r.pass % 5 + 1);
    make_directories(day);
    for (std::size_t part = 0; part < 20; ++part) {
      std::string text = "ms;x;y;";
      for (int k = 0; k < 16; ++k) text += "taxel" + std::to_string(k) + (k < 15 ? ";" : "\n");
      for (std::size_t i = part * r.frames() / 20; i < (part + 1) * r.frames() / 20; ++i) {
        text += format(1e3 * r.time_s[i]) + ";" + format(r.position_mm[2 * i]) + ";" +
                format(r.position_mm[2 * i + 1]);
        for (std::size_t k = 0; k < 16; ++k) text += ";" + format(r.signals[16 * i + k]);
        text += "\n";
      }
      write_file(day + "/" + std::to_string(r.pass) + "_" + std::to_string(part) + ".csv", text);
      ++tables;
    }
  }
  ASSERT_EQ(tables, 100);
  const ProcessResult imported = succeed(
      "supertac-import log --sensor mat.json --columns time=ms:ms,x=x,y=y,values=taxel0-taxel15 "
      "--plate ridges6 --out data");
  EXPECT_TRUE(contains(imported.out, "100 recordings in"));
  EXPECT_EQ(read_recording(path("data/ridges6_t1_p1_v0.safetensors")).metadata.at("group"), "day1");
  train("--stride 8 --split group");
  EXPECT_EQ(evaluate().at("all").at("windows"), 40);

  const std::string one_day =
      "supertac-import log/day1 --sensor mat.json --plate ridges6 --out refused --columns time=ms:ms,";
  EXPECT_TRUE(contains(run(one_day + "x=y,y=x,values=taxel0-taxel15").error, "are x and y exchanged?"));
  write_file(path("metres.csv"), "time,x,y\n0,0.018,0.02\n100000,0.018,0.08\n");
  EXPECT_TRUE(
      contains(run(one_day + "values=taxel0-taxel15 --positions metres.csv").error, "are these metres?"));

  write_file(path("log/day1/odd.csv"), "not a table\n");
  const std::string again =
      "supertac-import log --sensor mat.json --columns time=ms:ms,x=x,y=y --plate ridges6 --out more ";
  expect_exit(run(again), 1, "odd.csv: holds no line of numbers");
  succeed(again + "--skip-bad");
  EXPECT_EQ(run("supertac-import log --out none --columns time=ms").code, 2);
}

// A person slides a round pad over a known plate: nothing says where it was but what it felt.
TEST_F(Array, ATableWithoutPositionsIsRegisteredAgainstItsPlate) {
  write_mat(6, 6, R"(2.5, "body": {"shape": "dome", "radius_mm": 47})");
  succeed("supertac-simulate --plates 3_Bumps --speeds 12 --trials 1 --passes 1 --sensor mat.json --out sim");
  const Recording truth = read_recording(list_recordings(path("sim")).front());
  write_file(path("slide.txt"), text_of(truth));
  const std::string import = "supertac-import --sensor mat.json --speed 12 ";
  EXPECT_TRUE(
      contains(succeed(import + "slide.txt --plate 3_Bumps --out data").out, "positions found, residual"));
  const Recording found = first_of("data");
  EXPECT_EQ(found.metadata.at("registration_reliable"), "yes");
  for (std::size_t i = 0; i < truth.frames(); ++i)
    if (const double y = truth.position_mm[2 * i + 1]; y > 30 && y < 80 && truth.lift_mm[i] == 0) {
      EXPECT_NEAR(found.position_mm[2 * i + 1], y, 0.6) << i;
    }

  // The same from what supertac-stream --record would have kept.
  Recording kept = truth;
  kept.position_mm.clear(), kept.lift_mm.clear();
  write_recording(path("kept.safetensors"), kept);
  succeed(import + "kept.safetensors --plate 3_Bumps --out again");
  EXPECT_EQ(first_of("again").position_mm, found.position_mm);
  // It names its plate: that is enough, and another plate a contradiction.
  succeed(import + "kept.safetensors --out named");
  EXPECT_EQ(first_of("named").position_mm, found.position_mm);
  EXPECT_TRUE(contains(run(import + "kept.safetensors --out named --plate 6_Bumps").error,
                       "was recorded over 3_Bumps, --plate says 6_Bumps"));
  EXPECT_TRUE(contains(run("supertac-import slide.txt --sensor mat.json --out nowhere").out,
                       " s, no positions: name its plate (--plate)"));
}

// A recording that is replayed, frame by frame, and in evaluation: after the last frame of each sample of the
// model's rate stream has drawn the picture that evaluate draws there.
TEST_F(Array, LivePicturesAreThoseOfEvaluation) {
  write_mat(5, 6, "4");
  for (const std::string sensor : {"", "--sensor mat.json"})
    for (const std::string rate : {"300", "100", "60"}) {
      std::filesystem::remove_all(path("data"));
      simulate("--speeds 20 --trials 1 --force " + sensor);
      train("--stride 90 --split none --force --rate " + rate);
      succeed(
          "supertac-evaluate --data data --model m.safetensors --split none --outputs outputs.safetensors "
          "--force");
      succeed("supertac-stream --recording " + list_recordings(path("data")).front() +
              " --model m.safetensors --out live.safetensors --quiet --force");
      const auto live = SafetensorsFile::read(path("live.safetensors"));
      const std::vector<float> drawn = live.f32("pictures"),
                               wanted = SafetensorsFile::read(path("outputs.safetensors")).f32("output");
      const ModelFile model = load_model(path("m.safetensors"));
      WindowSettings settings = model.windows();
      const WindowSet set = WindowSet::load(path("data"), {}, settings);
      const std::vector<double> times = live.f64("time_s");
      const Recording recording = first_of("data");
      const auto pixels = static_cast<std::ptrdiff_t>(set.image().pixels());
      ASSERT_EQ(static_cast<std::ptrdiff_t>(wanted.size()), pixels * static_cast<std::ptrdiff_t>(set.size()));
      std::map<std::size_t, std::ptrdiff_t> newest;  // of a sample: the last picture with it
      for (std::size_t i = 0; i < times.size(); ++i)
        newest[sample_at(times[i] - recording.time_s.front(), settings.rate_hz)] =
            static_cast<std::ptrdiff_t>(i);
      std::size_t compared = 0;
      for (std::size_t i = 0; i < set.size(); ++i) {
        const auto picture = newest.find(set.frame_of(i));
        if (picture == newest.end()) continue;  // the sample has no frame of its own
        ++compared;
        ASSERT_TRUE(std::equal(wanted.begin() + pixels * static_cast<std::ptrdiff_t>(i),
                               wanted.begin() + pixels * static_cast<std::ptrdiff_t>(i + 1),
                               drawn.begin() + pixels * picture->second))
            << sensor << ", " << rate << " Hz, window " << i;
      }
      EXPECT_GT(compared, set.size() / 4);
    }
}

// Tables of two days have the same names; what stands beside them is in folders of theirs.
TEST_F(Array, CompanionsBelongToTheirOwnTable) {
  write_mat(2, 2, "3", "[0, 100]");
  std::string frames;
  for (int i = 0; i < 50; ++i) frames += "1,2,3,4\n";
  for (const int day : {1, 2}) {
    const std::string name = "day" + std::to_string(day);
    make_directories(path("log/" + name)), make_directories(path("stage/" + name));
    write_file(path("log/" + name + "/1.csv"), frames + std::to_string(day) + ",2,3,4\n");
    write_file(path("stage/" + name + "/1.csv"),
               "0,0," + std::to_string(10 * day) + "\n1,0," + std::to_string(10 * day) + "\n");
  }
  const std::string import = "supertac-import log --sensor mat.json --positions stage --out ";
  succeed(import + "data");
  for (const std::string& file : list_recordings(path("data"))) {
    const Recording r = read_recording(file);
    const std::string day = r.metadata.at("group");
    EXPECT_EQ(r.position_mm[1], day == "day1" ? 10.0F : 20.0F);
    const auto made = nlohmann::json::parse(SafetensorsFile::read(file).metadata().at("provenance"));
    EXPECT_EQ(made["parents"]["table"], sha256(bytes("log/" + day + "/1.csv")));
  }
  write_file(path("stage/day1/1.txt"), std::string("0,0,1\n1,0,1\n"));
  EXPECT_TRUE(contains(run(import + "more").error, "holds two tables of the name 1"));

  Recording elsewhere = first_of("data");
  elsewhere.plate = "../unknown";
  write_recording(path("elsewhere.safetensors"), elsewhere);
  expect_exit(run("supertac-import elsewhere.safetensors --sensor mat.json --out none"), 1,
              "recording: plate expects a name without '/', got '../unknown'");
  EXPECT_EQ(run("supertac-import log --sensor mat.json --truth-range 5,5 --out none").code, 2);
}

}  // namespace supertac::array_test
