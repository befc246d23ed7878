#include "data/recordings/imports/imports.h"

#include "io/files/file.h"
#include "io/numbers/random.h"
#include "tests/support/test.h"

namespace supertac::text_import_test {

std::string line_of(double first) {
  std::string line;
  for (int k = 0; k < rig::kTaxels; ++k) line += std::to_string(first + 0.01 * k) + " ";
  return line + "\n";
}

/// `count` good lines, the n-th starting with 2 + n / 1000 volts.
std::string good_lines(int count) {
  std::string text;
  for (int i = 0; i < count; ++i) text += line_of(2 + 0.001 * i);
  return text;
}

struct Result {
  Recording recording;
  ImportReport report;
  std::string error;
};

Result import_text(const std::string& text) {
  TemporaryFolder folder;
  write_file(folder.file("1.txt"), text);
  Result result;
  try {
    result.recording = import_text_pass(folder.file("1.txt"), result.report);
  } catch (const FileError& error) {
    result.error = error.what();
  }
  return result;
}

TEST(TextImport, ReadsFramesInOrder) {
  const Result result = import_text(good_lines(3));
  EXPECT_EQ(result.error, "");
  ASSERT_EQ(result.recording.frames(), 3u);
  EXPECT_FLOAT_EQ(result.recording.signals[0], 2.0F);
  EXPECT_FLOAT_EQ(result.recording.signals[2 * rig::kTaxels + 5], 2.052F);
  EXPECT_EQ(result.recording.time_s, (std::vector<double>{0, 1 / rig::kFrameRateHz, 2 / rig::kFrameRateHz}));
  EXPECT_TRUE(result.recording.position_mm.empty());
  EXPECT_EQ(result.recording.metadata.at("time_base"), "nominal");
  EXPECT_EQ(result.recording.source, "imported");
}

TEST(TextImport, TakesTabsCommasWindowsLinesAndNoLastNewline) {
  std::string text = good_lines(2);
  for (char& c : text) c = c == ' ' ? '\t' : c;
  text += "2.1,2.1,2.1,2.1, 2.1,2.1,2.1,2.1, 2.1,2.1,2.1,2.1, 2.1,2.1,2.1,2.1\r\n\r\n";
  text += line_of(2.2).substr(0, line_of(2.2).size() - 2);
  const Result result = import_text(text);
  EXPECT_EQ(result.report.frames, 4u);
  EXPECT_EQ(result.report.empty, 1u);
}

TEST(TextImport, DropsEveryKindOfBadLineAndLeavesAGap) {
  const std::string good = line_of(2.0);
  const std::string cut = good.substr(0, 30) + "\n";
  const std::string glued = good.substr(0, good.size() - 1) + good;
  std::string text = good_lines(50) + cut + glued;
  for (const char* first : {"2.12.2", "x", "nan", "24.4", "-0.1"})
    text += first + good.substr(good.find(' '));
  const Result result = import_text(text + "\n" + good_lines(50));
  EXPECT_EQ(result.error, "");
  const ImportReport& report = result.report;
  EXPECT_EQ(report.lines, 108u);
  EXPECT_EQ(report.frames, 100u);
  EXPECT_EQ(report.dropped(), 7u);
  EXPECT_EQ(report.empty, 1u);
  EXPECT_EQ(result.recording.frames(), 100u);
  EXPECT_DOUBLE_EQ(result.recording.time_s[50],
                   57 / rig::kFrameRateHz);  // seven dropped frames, no blank line
}

TEST(TextImport, RefusesWhatIsNoRecording) {
  const std::pair<std::string, std::string> cases[] = {
      {"", "is empty"},
      {"\n \n\n", "is empty"},
      {"Some text\nof another kind\n", "2 of 2 lines are not 16 voltages"},
      {std::string(5000, '\0'), "is it a recording?"},
      {good_lines(8) + "1 2 3\n", "1 of 9 lines"}};
  for (const auto& [text, refusal] : cases)
    EXPECT_NE(import_text(text).error.find(refusal), std::string::npos) << import_text(text).error;
  EXPECT_EQ(import_text(good_lines(9) + "1 2 3\n").error, "");
  ImportReport report;
  EXPECT_EQ(what_of<FileError>([&] { import_text_pass("/nowhere/1.txt", report); }),
            "/nowhere/1.txt: cannot open the file: No such file or directory; check the name");
}

TEST(TextImport, OneEndlessLineIsOneBadLine) {
  const Result result = import_text(std::string(1 << 20, '1'));
  EXPECT_EQ(result.report.dropped(), 1u);
  EXPECT_NE(result.error, "");
}

TEST(TextImport, EveryPrefixAndRandomDamageEndInARecordingOrAnError) {
  const std::string text = good_lines(30);
  for (std::size_t length = 0; length < text.size(); length += 7) {
    const Result result = import_text(text.substr(0, length));
    EXPECT_EQ(result.error.empty(), result.recording.frames() > 0);
  }
  const RandomStream random(5, 5);
  for (std::uint64_t i = 0; i < 500; ++i) {
    std::string damaged = text;
    for (std::uint64_t j = 0; j < 5; ++j) {
      damaged[random.bits(i * 10 + j) % damaged.size()] =
          static_cast<char>(random.bits(1'000'000 + i * 10 + j));
    }
    const Result result = import_text(damaged);
    EXPECT_EQ(result.recording.frames(), result.error.empty() ? result.report.frames : 0);
    for (const float volts : result.recording.signals) ASSERT_TRUE(volts >= 0 && volts <= 3.3F);
  }
}

TEST(TextImport, RealRecording) {
  const char* folder = std::getenv("SUPERTAC_RECORDINGS");
  if (folder == nullptr) GTEST_SKIP() << "SUPERTAC_RECORDINGS is not set: no real recording checked";
  ImportReport report;
  const Recording recording = import_text_pass(std::string(folder) + "/3_Bumps/1/1.txt", report);
  EXPECT_EQ(report.lines, 9694u);
  EXPECT_EQ(report.frames, recording.frames());
  EXPECT_EQ(report.dropped() + report.frames, report.lines);
  EXPECT_EQ(report.frames, 9648u);
}

}  // namespace supertac::text_import_test
