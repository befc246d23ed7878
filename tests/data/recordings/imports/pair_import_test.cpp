#include "data/recordings/imports/imports.h"
#include "data/windows/split.h"
#include "io/files/file.h"
#include "tests/support/test.h"

namespace supertac::pair_import_test {

/// A file of pairs that a test can spoil before it is written.
struct PairFile {
  std::vector<std::uint64_t> input_shape = {10, 2, 3, 5}, target_shape = {10, 1, 12, 20};
  std::vector<float> input = std::vector<float>(10 * 2 * 3 * 5), target = std::vector<float>(10 * 12 * 20);
  std::vector<std::int64_t> group = {7, 7, 3, 3, 7, 9, 9, 12, 12, 40};
  bool with_group = true;
  std::string dtype = "F32";

  PairFile() {
    for (std::size_t i = 0; i < input.size(); ++i) input[i] = static_cast<float>(i);
    for (std::size_t i = 0; i < target.size(); ++i) target[i] = static_cast<float>(i % 101) / 100;
  }
  std::vector<Recording> import(const std::optional<Sensor>& sensor = {}) const {
    const TemporaryFolder folder;
    std::vector<TensorToWrite> tensors = {{"input", dtype, input_shape, std::as_bytes(std::span(input))},
                                          {"target", "F32", target_shape, std::as_bytes(std::span(target))}};
    if (with_group) tensors.push_back({"group", "I64", {group.size()}, std::as_bytes(std::span(group))});
    write_safetensors(folder / "pairs.safetensors", {}, tensors);
    return import_pairs(SafetensorsFile::read(folder / "pairs.safetensors"), sensor);
  }
};

TEST(PairImport, ARecordingForEachGroupWithChannelsLastAndItsTruth) {
  const TemporaryFolder folder;
  const std::vector<Recording> recordings = PairFile().import();
  ASSERT_EQ(recordings.size(), 5u);
  std::vector<std::string> names;
  for (const Recording& r : recordings) names.push_back(r.plate);
  EXPECT_EQ(names, (std::vector<std::string>{"03", "07", "09", "12", "40"})) << "sorted as numbers are";
  const Recording& seven = recordings[1];
  EXPECT_EQ(seven.metadata.at("group"), "07");
  EXPECT_EQ(seven.frames(), 3u);
  EXPECT_EQ(seven.array, (TaxelArray{3, 5, 1, 2}));
  EXPECT_TRUE(seven.signal_scale.rises());
  EXPECT_EQ(seven.signal_scale.low(), 0);
  EXPECT_EQ(seven.signal_scale.high(), 299);
  // The third frame of group 7 is pair 4, which begins at 120; row 1, column 2 of its channels:
  EXPECT_EQ(seven.signals[2 * 30 + (1 * 5 + 2) * 2], 120 + 7);
  EXPECT_EQ(seven.signals[2 * 30 + (1 * 5 + 2) * 2 + 1], 120 + 15 + 7);
  EXPECT_EQ(seven.truth[2 * 240 + 3], static_cast<float>((4 * 240 + 3) % 101) / 100);
  write_recording(folder / "r.safetensors", seven);
  EXPECT_EQ(read_recording(folder / "r.safetensors").truth, seven.truth);
}

TEST(PairImport, RefusesSharesUnderASensorOfCounts) {
  PairFile pairs;
  for (float& value : pairs.input) value /= 299;
  const Sensor sensor{.array = {3, 5, 2.5, 2}, .scale = {.unit = "counts", .rest = 40, .span = -860}};
  EXPECT_ERROR(
      (void)pairs.import(sensor), FileError,
      "input runs from 0 to 1, the sensor's range is 40 to 900 counts; save it in the sensor's unit, "
      "or mend the sensor's file");
  for (float& value : pairs.input) value = 40 + 860 * value;
  EXPECT_EQ(pairs.import(sensor).size(), 5U);
}

// Targets of other frames than the inputs: of 400 pairs each shows what the input felt 12 pairs before.
TEST(PairImport, RefusesTargetsThatComeLate) {
  for (const int late : {0, 12}) {
    PairFile file;
    file.with_group = false;
    file.input_shape = {400, 1, 2, 2}, file.target_shape = {400, 1, 4, 4};
    file.input.clear(), file.target.clear();
    const auto load = [](int i) {
      float sum = 0;
      for (const int begin : {30, 72, 103, 180, 215, 290, 340})
        sum +=
            std::clamp(static_cast<float>(std::min(i - begin, begin + 11 + begin % 9 - i)) / 4, 0.0F, 0.8F);
      return sum;
    };
    for (int i = 0; i < 400; ++i) {
      file.input.insert(file.input.end(), 4, load(i));
      file.target.insert(file.target.end(), 16, load(i - late));
    }
    if (late == 0) {
      EXPECT_EQ(file.import().size(), 1u);
      continue;
    }
    const std::string what = what_of<FileError>([&] { file.import(); });
    EXPECT_NE(what.find("target shows touches 12.0 +- "), std::string::npos) << what;
    EXPECT_NE(what.find(" frames later than input; pair each input"), std::string::npos) << what;
  }
}

TEST(PairImport, GroupsStayTogetherInASplit) {
  PairFile file;
  WindowSet frames({.timesteps = 1});
  for (const Recording& r : file.import()) frames.add(r);
  const Split split = make_split(frames, SplitKind::group, 1);
  EXPECT_EQ(split.train.size() + split.test.size(), 10u);
  for (const std::uint32_t a : split.test)
    for (const std::uint32_t b : split.train) EXPECT_NE(frames.pass_of(a), frames.pass_of(b));
  file.with_group = false;
  const std::vector<Recording> loose = file.import();
  ASSERT_EQ(loose.size(), 1u);
  EXPECT_EQ(loose.front().plate, "pairs");
  EXPECT_FALSE(loose.front().metadata.contains("group"));
}

TEST(PairImport, ASensorSaysWhatTheNumbersMean) {
  Sensor sensor{.array = {3, 5, 2.5, 2}, .scale = {.unit = "mV", .rest = 300, .span = 250}};
  const Recording first = PairFile().import(sensor).front();
  EXPECT_EQ(first.signal_scale, sensor.scale);
  EXPECT_EQ(first.array, sensor.array);
  sensor.array.rows = 4;
  EXPECT_ERROR(
      PairFile().import(sensor), FileError,
      "pairs.safetensors: holds frames of 3x5 taxels at 2.5 mm with 2 channels, expected those of the "
      "sensor, 4x5 taxels at 2.5 mm with 2 channels");
}

TEST(PairImport, RefusesWhatDoesNotFitTogether) {
  const std::pair<void (*)(PairFile&), const char*> cases[] = {
      {[](PairFile& f) {
         f.target_shape = {10, 1, 20, 12};
       },
       "input [10,2,3,5], target [10,1,20,12]: expected target's height and width to be 2"},
      {[](PairFile& f) {
         f.target_shape = {5, 2, 12, 20};
       },
       "as many targets as inputs"},
      {[](PairFile& f) {
         f.input_shape = {10, 30, 1};
       },
       "tensor 'input' is F32 [10,30,1], expected F32 [N,C,H,W]"},
      {[](PairFile& f) { f.dtype = "I32"; }, "tensor 'input' is I32"},
      {[](PairFile& f) { f.input[65] = std::nanf(""); }, "input of pair 2 holds nan, expected finite values"},
      {[](PairFile& f) { f.target[0] = 1.5F; }, "target of pair 0 holds 1.5, expected 0 to 1"},
      {[](PairFile& f) {
         f.input_shape = {10, 10, 3, 1};
       },
       "expected 1 to 8 channels"},
      {[](PairFile& f) { f.group.resize(3); }, "tensor 'group' is I64 [3], expected I64 [10]"}};
  for (const auto& [spoil, expected] : cases) {
    PairFile file;
    spoil(file);
    EXPECT_ERROR(file.import(), FileError, expected);
  }
  const TemporaryFolder folder;
  const std::vector<float> input(10 * 2 * 3 * 5);
  write_safetensors(folder / "a", {}, {{"input", "F32", {10, 2, 3, 5}, std::as_bytes(std::span(input))}});
  EXPECT_EQ(
      what_of<FileError>([&] { (void)import_pairs(SafetensorsFile::read(folder / "a")); }),
      folder / "a" + ": has no tensor 'target'; expected input F32 [N,C,H,W] and target F32 [N,1,sH,sW]");
}

}  // namespace supertac::pair_import_test
