#include "data/recordings/recording.h"

#include "io/files/file.h"
#include "io/files/safetensors.h"
#include "tests/data/test_recordings.h"
#include "tests/support/test.h"

namespace supertac::recording_test {

Recording example() {
  Recording recording = make_recording({.plate = "3_Bumps", .trial = 2, .pass = 5, .frames = 7});
  recording.metadata["filter_s"] = "0.0992";
  return recording;
}

TEST(Recording, RoundTripKeepsEverything) {
  TemporaryFolder folder;
  Recording written = example();
  written.position_mm[3] = std::numeric_limits<float>::quiet_NaN();
  write_recording(folder.file("a.safetensors"), written);
  const Recording read = read_recording(folder.file("a.safetensors"));
  EXPECT_EQ(read.time_s, written.time_s);
  EXPECT_EQ(read.signals, written.signals);
  ASSERT_EQ(read.position_mm.size(), written.position_mm.size());
  EXPECT_TRUE(std::isnan(read.position_mm[3]));
  EXPECT_EQ(read.position_mm[4], written.position_mm[4]);
  EXPECT_EQ(read.plate, "3_Bumps");
  EXPECT_EQ(read.trial, 2);
  EXPECT_EQ(read.pass, 5);
  EXPECT_EQ(read.speed_mm_s, 10);
  EXPECT_EQ(read.source, "simulated");
  EXPECT_EQ(read.metadata, written.metadata);
  written.position_mm.clear();
  write_recording(folder.file("b"), written);
  EXPECT_TRUE(read_recording(folder.file("b")).position_mm.empty());
}

TEST(Recording, CarriesItsArrayAndUnitUnlessTheyAreTheRigs) {
  TemporaryFolder folder;
  write_recording(folder.file("rig"), example());
  for (const char* key : {"array", "signals"})
    EXPECT_FALSE(SafetensorsFile::read(folder.file("rig")).metadata().contains(key)) << key;
  Recording written = example();
  written.array = {.rows = 2, .columns = 3, .pitch_mm = {2.5, 4}, .channels = 3};
  written.signals.resize(written.frames() * 18);
  written.signal_scale = {.unit = "counts", .rest = 1000, .span = -16'000'000};
  write_recording(folder.file("other"), written);
  const Recording read = read_recording(folder.file("other"));
  EXPECT_EQ(read.array, written.array);
  EXPECT_EQ(read.signal_scale, written.signal_scale);
  EXPECT_EQ(read.signals, written.signals);
  EXPECT_EQ(read.metadata, written.metadata);
  EXPECT_EQ(read.array.text(), "2x3 taxels at 2.5 x 4 mm with 3 channels");
}

/// A file as write_recording makes it, with some of its parts replaced.
struct Parts {
  std::map<std::string, std::string> metadata = {{"kind", "recording"}, {"plate", "p"},
                                                 {"trial", "1"},        {"pass", "1"},
                                                 {"speed_mm_s", "10"},  {"source", "imported"}};
  std::vector<double> time_s = {0, 0.1};
  std::vector<float> signals = std::vector<float>(32, 2.4F);
  std::vector<std::uint64_t> signals_shape = {2, 16};
};

std::string message_of_parts(const Parts& parts) {
  TemporaryFolder folder;
  write_safetensors(folder.file("a"), parts.metadata,
                    {{"time_s", "F64", {parts.time_s.size()}, std::as_bytes(std::span(parts.time_s))},
                     {"volts", "F32", parts.signals_shape, std::as_bytes(std::span(parts.signals))}});
  const std::string message = what_of<FileError>([&] { read_recording(folder.file("a")); });
  const std::size_t path = folder.file("a: ").size();  // every message begins with it
  return message.starts_with(folder.file("a: ")) ? message.substr(path) : message;
}

// Counts are no volts; files until 0.2, in which all signals were, are read for ever.
TEST(Recording, ATensorIsNamedForWhatItHolds) {
  TemporaryFolder folder;
  Recording written = example();
  write_recording(folder.file("rig"), written);
  EXPECT_TRUE(SafetensorsFile::read(folder.file("rig")).tensors().contains("volts"));
  written.signal_scale = {.unit = "counts", .rest = 0, .span = -900};
  write_recording(folder.file("counts"), written);
  const SafetensorsFile file = SafetensorsFile::read(folder.file("counts"));
  EXPECT_TRUE(file.tensors().contains("signals"));
  EXPECT_FALSE(file.tensors().contains("volts"));
  EXPECT_EQ(recording_of(file).signals, written.signals);
  Parts old;
  old.metadata["signals"] = R"({"unit":"counts","pressed":"higher","range":[0,900]})";
  write_safetensors(folder.file("old"), old.metadata,
                    {{"time_s", "F64", {2}, std::as_bytes(std::span(old.time_s))},
                     {"volts", "F32", {2, 16}, std::as_bytes(std::span(old.signals))}});
  EXPECT_EQ(read_recording(folder.file("old")).signals, old.signals);
}

TEST(Recording, RefusesAnArrayThatIsNone) {
  TemporaryFolder folder;
  Recording recording = example();
  recording.array.rows = 65;
  recording.signals.resize(recording.frames() * 17 * 4);
  EXPECT_REFUSAL("write_recording: signals has 476 values, expected 1820 for 7 frames",
                 write_recording(folder.file("a"), recording));
  constexpr std::pair<const char*, const char*> kArrays[] = {
      {"4x4", "metadata \"array\": not valid JSON at byte 2"},
      {"4", "metadata \"array\": expected an object {...}, found 4"},
      {R"({"rows": 4})", "metadata \"array\": expected a key \"columns\", found none"},
      {R"({"rows": 4, "columns": 4, "channels": 1, "pitch_mm": [3]})",
       "metadata \"array\": \"pitch_mm\" must be a number, or [along a row, from row to row], found [3]"},
      {R"({"rows": 0, "columns": 4, "pitch_mm": 3, "channels": 1})",
       "array: layout expects 1 to 64 rows and columns, 1 to 8 channels, a pitch of 0.1 to 100 mm, got 0x4 "
       "taxels "
       "at 3 mm"}};
  for (const auto& [array, refusal] : kArrays) {
    Parts parts;
    parts.metadata["array"] = array;
    EXPECT_EQ(message_of_parts(parts), refusal);
  }
}

TEST(Recording, FileNameTellsWhatItIs) {
  Recording recording = example();
  EXPECT_EQ(recording_file_name(recording), "3_Bumps_t2_p5_v10.safetensors");
  recording.speed_mm_s = 7.5;
  EXPECT_EQ(recording_file_name(recording), "3_Bumps_t2_p5_v7.5.safetensors");
}

TEST(Recording, KnowsWhatBreaksARule) {
  const std::pair<void (*)(Recording&), const char*> cases[] = {
      {[](Recording& r) { r.signals.pop_back(); }, "signals has 111 values, expected 112 for 7 frames"},
      {[](Recording& r) { r.position_mm.pop_back(); }, "position_mm has 13 values, expected 14 for 7 frames"},
      {[](Recording& r) { r.time_s[3] = r.time_s[2]; }, "time_s does not increase at frame 3"},
      {[](Recording& r) { r.time_s[3] = std::nan(""); }, "time_s is not finite at frame 3"},
      {[](Recording& r) { r.time_s[6] = 1e300; }, "time_s lies beyond 1e+10 s"},
      {[](Recording& r) { r.signals[20] = INFINITY; }, "signals are not finite at frame 1, taxel 4"},
      {[](Recording& r) { r.trial = -1; }, "trial and pass must not be negative"},
      {[](Recording& r) { r.speed_mm_s = std::nan(""); }, "speed_mm_s is nan, expected 0 to 10000"}};
  for (const auto& [damage, problem] : cases) {
    Recording recording = example();
    damage(recording);
    EXPECT_EQ(problem_of(recording), problem);
  }
  for (const auto& [key, expected] : {std::pair("filter_s", "0 to 10 s"), {"began_s", "seconds since 1970"}})
    for (const char* impossible : {"-1", "1e300", "nan", "long"}) {
      Recording recording = example();
      recording.metadata[key] = impossible;
      EXPECT_EQ(problem_of(recording), std::string(key) + " is '" + impossible + "', expected " + expected);
    }
  Recording recording = example();
  recording.metadata["began_s"] = "1700000000.5";
  EXPECT_EQ(problem_of(recording), std::nullopt);
}

TEST(Recording, IsNeitherWrittenNorReadThatBreaksARule) {
  const TemporaryFolder folder;
  for (const std::string member : {"plate", "array"}) {
    Recording recording = example();
    recording.metadata[member] = "4x4";
    EXPECT_REFUSAL(
        "write_recording: metadata expects no member of the recording, got '" + member + "'; set it there",
        write_recording(folder.file("a"), recording));
  }
  Recording recording = example();
  recording.signals.pop_back();
  EXPECT_REFUSAL("write_recording: signals has 111 values, expected 112 for 7 frames",
                 write_recording(folder.file("a"), recording));
  EXPECT_EQ(folder.entries(), 0u);
  const std::pair<void (*)(Parts&), const char*> cases[] = {
      {[](Parts&) {}, "nothing thrown"},
      {[](Parts& p) { p.metadata["kind"] = "checkpoint"; }, "is a 'checkpoint', expected a recording"},
      {[](Parts& p) { p.metadata["trial"] = "-1"; }, "trial is '-1', expected a number from 0 to 1000000"},
      {[](Parts& p) { p.metadata["pass"] = "99999999999999999999"; },
       "pass is '99999999999999999999', expected a number from 0 to 1000000"},
      {[](Parts& p) { p.metadata["speed_mm_s"] = "fast"; }, "speed_mm_s is 'fast', expected a number"},
      {[](Parts& p) { p.metadata.erase("plate"); }, "is not a recording: the metadata lacks 'plate'"},
      {[](Parts& p) {
         p.signals_shape = {16, 2};
       },
       "tensor 'volts' has shape [16,2], expected [2,16]"},
      {[](Parts& p) { p.signals[20] = NAN; },
       "signals are not finite at frame 1, taxel 4; record or import it again"}};
  for (const auto& [damage, refusal] : cases) {
    Parts parts;
    damage(parts);
    EXPECT_EQ(message_of_parts(parts), refusal);
  }
}

TEST(Recording, ListsAFolderByName) {
  TemporaryFolder folder;
  EXPECT_ERROR(list_recordings(folder.path()), FileError, "has no recordings");
  EXPECT_ERROR(list_recordings(folder.file("none")), FileError, "cannot list the folder");
  for (const char* name : {"b.safetensors", "a.safetensors", "notes.txt"}) write_file(folder.file(name), "x");
  EXPECT_EQ(list_recordings(folder.path()),
            (std::vector<std::string>{folder.file("a.safetensors"), folder.file("b.safetensors")}));
}

}  // namespace supertac::recording_test
