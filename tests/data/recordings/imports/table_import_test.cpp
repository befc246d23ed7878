#include "data/recordings/imports/imports.h"

#include "io/files/file.h"
#include "io/numbers/numbers.h"
#include "io/numbers/random.h"
#include "tests/support/test.h"

namespace supertac::table_import_test {

/// Two by two taxels whose counts rise, 100 frames/s.
Sensor mat_of_tables() {
  Sensor sensor;
  sensor.name = "mat";
  sensor.array = {2, 2, 5, 1};
  sensor.scale = {"counts", 40, -860};
  sensor.rate_hz = 100;
  return sensor;
}

class TableImport : public testing::Test {
 protected:
  std::string file(const std::string& text, const std::string& name = "a.csv") {
    write_file(folder_.file(name), text);
    return folder_.file(name);
  }
  Recording import(const std::string& path, const std::string& map = "",
                   const Sensor& sensor = mat_of_tables()) {
    return recording_of_table(path, read_table(path), column_map(map), sensor);
  }
  void expect_refusal(const std::string& path, const std::string& map, const std::string& text) {
    EXPECT_ERROR(import(path, map), FileError, text);
  }

  /// `rows` of `line`, but for row `at`, which is `other`.
  static std::string lines(int rows, const std::string& line, int at = -1, const std::string& other = "") {
    std::string text;
    for (int i = 0; i < rows; ++i) text += i == at ? other : line;
    return text;
  }

  /// numpy.save of an array, version 1.
  std::string npy(const std::string& name, const std::string& type, const std::string& shape,
                  const std::vector<float>& values, const std::string& order = "False") {
    std::string header =
        "{'descr': '" + type + "', 'fortran_order': " + order + ", 'shape': (" + shape + "), }";
    header.resize((10 + header.size() + 64) / 64 * 64 - 10 - 1, ' ');
    header += '\n';
    std::string bytes = std::string("\x93NUMPY\x01\x00", 8) + static_cast<char>(header.size() % 256) +
                        static_cast<char>(header.size() / 256) + header;
    bytes.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float));
    return file(bytes, name);
  }

  /// `rows` of "time_ms,a,b,c,d,x,y".
  static std::string csv(int rows, const std::string& names = "t_ms,a,b,c,d,px,py\n") {
    std::string text = names;
    for (int i = 0; i < rows; ++i)
      text += std::to_string(10 * i) + "," + std::to_string(100 + i) + ",200,300,400," + format(0.5 * i) +
              ",20\n";
    return text;
  }

  TemporaryFolder folder_;
};

// Seconds since 1970 stay so, for MCAP and whoever lays recordings beside others; a clock since boot says no
// date.
TEST_F(TableImport, ATimeSince1970IsOne) {
  const auto began = [&](double first) {
    std::string text = "t,a,b,c,d\n";
    for (int i = 0; i < 50; ++i) text += format(first + 0.01 * i, 3) + ",50,60,70,80\n";
    const Recording recording = import(file(text), "time=t,values=a-d");
    return recording.began_s() + recording.time_s.front();
  };
  EXPECT_DOUBLE_EQ(began(1790000000.25), 1790000000.25);
  EXPECT_TRUE(std::isnan(began(90000.5)));
}

TEST_F(TableImport, ColumnsByNameMillisecondsAndPositions) {
  const Recording r = import(file(csv(50)), "time=t_ms:ms,x=px,y=py");
  ASSERT_EQ(r.frames(), 50U);
  EXPECT_DOUBLE_EQ(r.time_s[49], 0.49);
  EXPECT_EQ(std::vector<float>(r.signals.begin() + 4, r.signals.begin() + 8),
            (std::vector<float>{101, 200, 300, 400}));
  EXPECT_EQ(r.position_mm[2], 0.5F);
  EXPECT_EQ(r.position_mm[3], 20.0F);
  EXPECT_EQ(r.signal_scale, mat_of_tables().scale);
  EXPECT_EQ(r.array, mat_of_tables().array);
}

TEST_F(TableImport, ColumnsByNumberRangesAndOtherSeparators) {
  std::string text = csv(50, "");
  for (char& c : text) c = c == ',' ? ';' : c;
  const Recording r =
      import(file("\xEF\xBB\xBF# made by hand\r\n\r\n" + text), "time=0:ms,values=4-4,values=1-3");
  EXPECT_EQ(std::vector<float>(r.signals.begin(), r.signals.begin() + 4),
            (std::vector<float>{400, 100, 200, 300}));
  const std::string blanks = lines(20, " 50   60\t70 80\n");
  EXPECT_EQ(import(file(blanks)).signals[2], 70.0F);
  EXPECT_DOUBLE_EQ(import(file(blanks)).time_s[19], 0.19);  // the sensor's rate
}

TEST_F(TableImport, QuotesAndTrailingSeparatorsAreNoPartOfACell) {
  std::string quoted = "\"t\",\"a\",\"b\",\"c\",\"d\"\n";
  for (int i = 0; i < 30; ++i) quoted += "\"" + std::to_string(10 * i) + "\",\"50\",60,70,\"80\"\n";
  EXPECT_EQ(import(file(quoted), "time=t:ms,values=a-d").signals[3], 80.0F);
  EXPECT_EQ(import(file(lines(30, "50,60,70,+80,\n"))).signals[3], 80.0F);
}

TEST_F(TableImport, RemarksAndEmptyLinesTakeNoTime) {
  EXPECT_DOUBLE_EQ(import(file(lines(30, "50,60,70,80\n\n# a remark\n", 10, "50,6\n\n"))).time_s[28], 0.29);
  const std::string odd = lines(31, "50,60,70,80\n", 0, "50,60,?,80\n");  // no number, and no names
  EXPECT_EQ(read_table(file(odd)).dropped, 1U);
  EXPECT_TRUE(read_table(file(odd)).names.empty());
}

TEST_F(TableImport, TaxelsStandInTheSensorsOrder) {
  Sensor sensor = mat_of_tables();
  sensor.order = {3, 2, 1, 0};
  EXPECT_EQ(import(file(lines(20, "50,60,70,80\n")), "", sensor).signals[0], 80.0F);
}

TEST_F(TableImport, ADriftIsTakenAwayWhereTheSensorsFileAsks) {
  std::string text;
  for (int i = 0; i < 6000; ++i) {  // a minute in which the first taxel rises by 60 of 860, and then a press
    const int press = i >= 5900 ? 300 : 0;
    text += std::to_string(40 + i / 100 + press) + ",40,40,40\n";
  }
  Sensor sensor = mat_of_tables();
  EXPECT_EQ(import(file(text), "", sensor).signals[4 * 5800], 98);
  sensor.follow_rest_s = 5;
  const Recording r = import(file(text), "", sensor);
  for (const std::size_t i : {2000U, 4000U, 5800U}) EXPECT_NEAR(r.signals[4 * i], 40, 6) << i;
  EXPECT_NEAR(r.signals[4 * 5999UL], 340, 6);
  EXPECT_FLOAT_EQ(r.signals[4 * 5999UL + 1], 40);
}

TEST_F(TableImport, ACoarseClockIsSpread) {
  std::string text;
  for (int i = 0; i < 40; ++i) text += std::to_string(i / 4 * 40) + ",50,60,70,80\n";
  const Recording r = import(file(text), "time=0:ms");
  for (int i = 0; i < 40; ++i) EXPECT_NEAR(r.time_s[static_cast<std::size_t>(i)], 0.01 * i, 2e-4) << i;
}

TEST_F(TableImport, ACounterMayRunOver) {
  for (const std::int64_t range : {std::int64_t{1} << 16, std::int64_t{1} << 32}) {
    for (const std::int64_t top : {range, range / 2}) {  // unsigned, signed
      std::string text;
      for (std::int64_t i = 0; i < 60; ++i) {
        const std::int64_t t = top - 300 + 10 * i;
        text += std::to_string(t < top ? t : t - range) + ",50,60,70,80\n";
      }
      const Recording r = import(file(text), "time=0:ms");
      for (std::size_t i = 1; i < 60; ++i) EXPECT_NEAR(r.time_s[i] - r.time_s[i - 1], 0.01, 1e-9) << top;
    }
  }
  std::string restarted;  // 13 s would have gone by
  for (int i = 0; i < 60; ++i) restarted += std::to_string((i < 30 ? 52'000 : 0) + 10 * i) + ",50,60,70,80\n";
  expect_refusal(file(restarted), "time=0:ms", "column 0 as time falls in line 31, from 52290 to 300");
}

TEST_F(TableImport, ALineThatIsCutLeavesItsTimeEmpty) {
  const std::string path = file(lines(30, "50,60,70,80\n", 10, "50,6\n"));
  EXPECT_EQ(read_table(path).dropped, 1U);
  const Recording r = import(path);
  EXPECT_EQ(r.frames(), 29U);
  EXPECT_DOUBLE_EQ(r.time_s[10], 0.11);
}

TEST_F(TableImport, WrongColumnsAreNamedWithTheReason) {
  const std::string path = file(csv(50));
  expect_refusal(path, "time=stamp",
                 "there is no column 'stamp': the file has columns 0 to 6 and the names t_ms, a");
  expect_refusal(path, "time=9", "there is no column '9'");
  expect_refusal(path, "",
                 "7 columns hold values, all that --columns does not name; a frame of the sensor has 4");
  expect_refusal(
      path, "time=t_ms,x=px,y=py",
      "column 0 (t_ms) as time has 0.1 frames/s, the sensor is said to send 100.0; is it in s, ms or us");
  expect_refusal(path, "time=t_ms:ms,values=b-d,values=t_ms", "a column has two meanings");
  expect_refusal(path, "time=t_ms:ms,values=d-a", "values 'd-a' end before they begin");
}

TEST_F(TableImport, ImpossibleValuesAreNamed) {
  std::string text;
  for (int i = 0; i < 30; ++i) text += std::to_string(i == 7 ? 3 : i) + ",50,60,70,4.5\n";
  expect_refusal(file(text), "time=0", "column 0 as time falls in line 8, from 6 to 3");
  expect_refusal(
      file(lines(30, "50,60,70,4095\n")), "",
      "column 3 as value 3 of the frame runs from 4095 to 4095, the sensor's range is 40 to 900 counts");
  expect_refusal(file(lines(30, "50,60,70,80\n", 3, "50,60,nan,80\n")), "",
                 "column 2 as value 2 of the frame is nan in line 4");
  expect_refusal(file("a b\nc d\n"), "", "holds no line of numbers (too few lines)");
  std::string frames, slip, late, ragged;  // late: damaged behind what the probe looks at
  std::array<int, 8> walks;
  walks.fill(500);
  for (unsigned i = 0; i < 300; ++i) {
    frames += "\xAA\x55", slip += '\xC0';
    ragged += std::string("5,6,7,8,9,5,6,7,8,9").substr(0, 2 * (i % 10) + 1) + "\n";
    late += lines(30, i < 240 ? "50,60,70,80\n" : "\1\2\3\4\5\6\7\n");
    for (unsigned k = 0; k < 8; ++k) {
      walks[k] += static_cast<int>(21 * RandomStream(1, k).uniform(i)) - 10;
      const auto value = static_cast<unsigned>(walks[k]);
      frames += static_cast<char>(value % 256), frames += static_cast<char>(value / 256);
      const char low = static_cast<char>(value % 256);
      slip += low == '\xC0' ? "\xDB\xDC" : low == '\xDB' ? "\xDB\xDD" : std::string(1, low);
    }
    slip += '\xC0';
  }
  expect_refusal(file(frames), "", "holds no table but binary frames; supertac-stream --sensor FILE");
  expect_refusal(file(slip), "", "holds no line of numbers (frames in SLIP");
  expect_refusal(file(late), "", "1800 of 9000 lines are not 4 numbers, expected at most a tenth");
  expect_refusal(file(ragged), "", "holds lines of numbers, but no form that half of them have (");
  for (const auto& [map, why] :
       {std::pair("time=0:h", "time is in 'h', expected s, ms, us or ns"),
        {"time=0,x=1,y=2,time=3", "names time twice"},
        {"x=0", "names only one of x and y; a position has both"},
        {"z=0", "found 'z=0', expected time=COLUMN[:s|ms|us|ns], x=COLUMN, y=COLUMN, values=FIRST-LAST"}})
    EXPECT_REFUSAL(why, column_map(map));
}

TEST_F(TableImport, NumpyArraysAndWhatTheyMayNotBe) {
  std::vector<float> values(40);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = 50 + static_cast<float>(i);
  EXPECT_EQ(import(npy("a.npy", "<f4", "10, 4", values)).signals, values);
  EXPECT_EQ(import(npy("a.npy", "<f4", "10, 2, 2", values)).signals, values);
  Sensor row = mat_of_tables();
  row.array.rows = 1, row.array.columns = 4;
  const std::string path = npy("a.npy", "<f4", "10, 2, 2", values);
  EXPECT_EQ(what_of<FileError>([&] { recording_of_table(path, read_table(path), {}, row); }),
            path + ": holds frames of 2x2, the sensor's file says 1x4 taxels at 5 mm");
  EXPECT_EQ(import(npy("b.npy", "<f4", "10, 1, 4", values)).frames(), 10U);
  row.order = {3, 2, 1, 0};
  EXPECT_EQ(recording_of_table(path, read_table(path), {}, row).frames(), 10U);
  expect_refusal(npy("a.npy", ">f4", "10, 4", values), "", "holds numbers of type '>f4', expected one of f4");
  expect_refusal(npy("a.npy", "<f4", "10, 4", values, "True"), "", "Fortran's order");
  expect_refusal(npy("a.npy", "<f4", "11, 4", values), "", "it is cut or damaged");
  expect_refusal(npy("a.npy", "<f4", "", values), "", "is of rank 0");
  expect_refusal(file("no array", "a.npy"), "", "expected a file of numpy.save");
  expect_refusal(file("", "a.npy"), "", "expected a file of numpy.save");
}

TEST_F(TableImport, PositionsOfAnotherLogAreInterpolated) {
  Recording r = import(file(csv(50)), "time=t_ms:ms,values=a-d");
  add_positions(r, "log", read_table(file("time,y,x\n100,20,0\n300,40,10\n", "log.csv")), 1e-3);
  EXPECT_TRUE(std::isnan(r.position_mm[2 * 9]));
  EXPECT_NEAR(r.position_mm[2 * 20], 5, 1e-4);
  EXPECT_NEAR(r.position_mm[2 * 20 + 1], 30, 1e-4);
  EXPECT_NEAR(r.position_mm[2 * 30], 10, 1e-4);
  EXPECT_TRUE(std::isnan(r.position_mm[2 * 31]));
  const Table afar = read_table(file("0,0,0\n300,1e300,40\n", "log.csv"));
  EXPECT_EQ(what_of<FileError>([&] { add_positions(r, "log", afar, 1e-3); }),
            "log: column 1 as a position holds 3.3333333333333335e+298, expected mm on the plate");
  const Table other_clock = read_table(file("100000,0,0\n100001,0,0\n", "log.csv"));
  EXPECT_EQ(what_of<FileError>([&] { add_positions(r, "log", other_clock, 1); }),
            "log: says where 0 of 50 frames were: it has times from 100000.000 to 100001.000 s, the "
            "frames from 0.000 to 0.490 s; are both of one clock, in the unit that --columns names?");
}

TEST_F(TableImport, TruthIsScaledAndCounted) {
  Recording r = import(file(csv(3)), "time=t_ms:ms,values=a-d");
  std::vector<float> images(3 * 4 * 6, 100);
  images[0] = 300;
  const Table table = read_table(npy("t.npy", "<f4", "3, 4, 6", images));
  EXPECT_EQ(what_of<FileError>([&] { add_truth(r, "t", table, 0, 1); }),
            "t: holds 300, expected 0 to 1: say what is 0 and what is 1 with --truth-range LOW,HIGH");
  add_truth(r, "t", table, 100, 300);
  EXPECT_EQ(r.truth_height, 4);
  EXPECT_EQ(r.truth_width, 6);
  EXPECT_EQ(r.truth[0], 1.0F);
  EXPECT_EQ(r.truth[1], 0.0F);
  const Table rank_3 = read_table(npy("t.npy", "<f4", "3, 4, 3, 2", images));
  EXPECT_EQ(what_of<FileError>([&] { add_truth(r, "t", rank_3, 100, 300); }),
            "t: has rows of rank 3, expected images: an array [frames, height, width] in a .npy file");
  const Table two = read_table(npy("t.npy", "<f4", "2, 4, 6", std::vector<float>(48)));
  EXPECT_EQ(what_of<FileError>([&] { add_truth(r, "t", two, 0, 1); }),
            "t: holds 2 images, the recording has 3 frames; expected one for each");
}

/// A line of the rig's text: voltages from `first` on.
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

class TextImport : public TableImport {
 protected:
  Recording import_text(const std::string& text) { return import_text_pass(file(text, "1.txt"), dropped_); }
  std::size_t dropped_ = 0;
};

TEST_F(TextImport, ReadsFramesInOrder) {
  const Recording recording = import_text(good_lines(4));
  ASSERT_EQ(recording.frames(), 4u);
  EXPECT_FLOAT_EQ(recording.signals[0], 2.0F);
  EXPECT_FLOAT_EQ(recording.signals[2 * rig::kTaxels + 5], 2.052F);
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_EQ(recording.time_s[i], static_cast<double>(i) / rig::kFrameRateHz);
  EXPECT_TRUE(recording.position_mm.empty());
  EXPECT_EQ(recording.metadata.at("time_base"), "nominal");
  EXPECT_EQ(recording.source, "imported");
}

TEST_F(TextImport, DropsEveryKindOfBadLineAndLeavesAGap) {
  const std::string good = line_of(2.0);
  std::string text = good_lines(50) + good.substr(0, 30) + "\n" + good.substr(0, good.size() - 1) + good;
  for (const char* first : {"2.12.2", "x", "nan", "24.4", "-0.1"})
    text += first + good.substr(good.find(' '));
  const Recording recording = import_text(text + "\n" + good_lines(50));
  EXPECT_EQ(dropped_, 7u);
  EXPECT_EQ(recording.frames(), 100u);
  EXPECT_DOUBLE_EQ(recording.time_s[50], 57 / rig::kFrameRateHz);  // seven dropped frames, no blank line
}

TEST_F(TextImport, RefusesWhatIsNoRecording) {
  const std::pair<std::string, std::string> cases[] = {
      {"", "is empty, expected a row a line"},
      {"Some text\nof another kind\n", "holds no line of numbers"},
      {std::string(5000, '\0'), "holds no line of numbers"},
      {std::string(1 << 20, '1'), "(no line ends in this text"},
      {lines(20, "1 2 3\n"),
       "20 of 20 lines are not 16 voltages from 0 to 3.3, expected at most a tenth; is"},
      {good_lines(8) + line_of(4), "1 of 9 lines are not 16 voltages"}};
  for (const auto& [text, refusal] : cases) EXPECT_ERROR(import_text(text), FileError, refusal);
  EXPECT_EQ(import_text(good_lines(9) + line_of(4)).frames(), 9U);
  EXPECT_EQ(what_of<FileError>([&] { import_text_pass("/nowhere/1.txt", dropped_); }),
            "/nowhere/1.txt: cannot open the file: No such file or directory; check the name");
}

TEST_F(TextImport, RandomDamageEndsInARecordingOrAnError) {
  const std::string text = good_lines(30);
  const RandomStream random(5, 5);
  for (std::uint64_t i = 0; i < 500; ++i) {
    std::string damaged = text.substr(0, text.size() - (i % 5 == 0 ? 7 * i : 0));
    for (std::uint64_t j = 0; j < 5; ++j)
      damaged[random.bits(i * 10 + j) % damaged.size()] =
          static_cast<char>(random.bits(1'000'000 + i * 10 + j));
    try {
      for (const float volts : import_text(damaged).signals) ASSERT_TRUE(volts >= 0 && volts <= 3.3F);
    } catch (const FileError&) {
    }
  }
}

}  // namespace supertac::table_import_test
