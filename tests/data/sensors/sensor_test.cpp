#include "data/sensors/sensor.h"

#include <nlohmann/json.hpp>
#include <random>

#include "io/files/file.h"
#include "tests/hardware/fake_sensor.h"
#include "tests/support/test.h"

namespace supertac::sensor_test {

using Json = nlohmann::ordered_json;

const char kMat[] = R"({"name": "velostat mat", "rows": 3, "columns": 4, "pitch_mm": 5, "unit": "counts",
  "pressed": "higher", "range": [40, 900], "rate_hz": 100, "port": "serial:/dev/ttyACM0@115200",
  "frame": {"kind": "text", "separator": ",", "skip": [1], "time": {"column": 0, "unit": "ms"}},
  "order": "column-major", "dead": [5]})";

// kMat with one key changed: a value, or null to take it away.
Sensor changed(const std::string& key, const Json& value) {
  Json json = Json::parse(kMat);
  Json* at = &json;
  std::string name = key;
  if (const auto dot = key.find('.'); dot != std::string::npos)
    at = &json[key.substr(0, dot)], name = key.substr(dot + 1);
  if (value.is_null())
    at->erase(name);
  else
    (*at)[name] = value;
  return sensor_of_json(json.dump(), "mat.json");
}

TEST(Sensor, IsReadFromAFile) {
  const Sensor mat = sensor_of_json(kMat, "mat.json");
  EXPECT_EQ(mat.name, "velostat mat");
  EXPECT_EQ(mat.array, (TaxelArray{.rows = 3, .columns = 4, .pitch_mm = 5}));
  EXPECT_EQ(mat.scale, (SignalScale{.unit = "counts", .rest = 40, .span = -860}));
  EXPECT_EQ(mat.frame.kind, FrameKind::text);
  EXPECT_EQ(mat.frame.skip, std::vector{1});
  EXPECT_EQ(mat.frame.time->column, 0);
  EXPECT_EQ(mat.frame.time->unit_s, 1e-3);
  EXPECT_EQ(mat.order, (std::vector{0, 3, 6, 9, 1, 4, 7, 10, 2, 5, 8, 11}));
  EXPECT_EQ(mat.dead, std::vector{5});
}

TEST(Sensor, PitchMayDifferAlongARowAndAcross) {
  const Sensor sensor = changed("pitch_mm", Json{4, 2.5});
  EXPECT_EQ(sensor.array.x_mm(3), 6);
  EXPECT_EQ(sensor.array.y_mm(8), 2.5);
  EXPECT_EQ(sensor.array.text(), "3x4 taxels at 4 x 2.5 mm");
  EXPECT_EQ(sensor_of_json(json_of(sensor).dump(), "a.json"), sensor);
}

TEST(Sensor, RigIsBuiltInAndItsFileGivesTheSameNumbers) {
  EXPECT_EQ(read_sensor("rig"), Sensor{});
  EXPECT_EQ(sensor_of_json(json_of(Sensor{}).dump(), "rig.json"), Sensor{});
}

TEST(Sensor, WritesWhatItReads) {
  const TemporaryFolder folder;
  Sensor sensor = sensor_of_json(kMat, "mat.json");
  for (int kind = 1; kind < 4; ++kind) {
    sensor.frame = {.kind = static_cast<FrameKind>(kind)};
    sensor.rest.assign(12, 0.1F * static_cast<float>(kind));
    sensor.gain.assign(12, 0.3F * static_cast<float>(kind));
    sensor.follow_rest_s = kind == 1 ? 0 : 2.5 * kind;
    if (kind == 2) sensor.frame.values = "taxels", sensor.frame.time = FrameTime{.key = "t", .unit_s = 1e-6};
    if (kind == 3)
      sensor.frame.header = "\xAA\x55", sensor.frame.trailer = "\n", sensor.frame.type = "i16",
      sensor.frame.big_endian = true, sensor.frame.checksum = "crc16-modbus",
      sensor.frame.time = FrameTime{.type = "u32", .unit_s = 1e-3};
    write_sensor(folder / "sensor.json", sensor);
    EXPECT_EQ(read_sensor(folder / "sensor.json"), sensor) << kind;
  }
  using Is = FrameField::Is;
  FrameFormat& f = sensor.frame;
  f.fields = {{.is = Is::counter, .type = "u16"},
              {.is = Is::values, .count = 5},
              {.is = Is::skip, .count = 3},
              {.is = Is::time},
              {.is = Is::values, .count = 7}};
  f.type = "i32", f.checksum_from = 1, f.checksum_big_endian = false;
  write_sensor(folder / "fields.json", sensor);
  EXPECT_EQ(read_sensor(folder / "fields.json"), sensor);
}

TEST(Sensor, RefusalsNameTheKeyAndWhatWasFound) {
  Json gains(12, 1);
  gains[3] = 0;
  const std::string
      pitch = "\"pitch_mm\" must be a number, or [along a row, from row to row], found ",
      array =
          "array: layout expects 1 to 64 rows and columns, 1 to 8 channels, a pitch of 0.1 to 100 mm, got ";
  const std::tuple<const char*, Json, std::string> cases[] = {
      {"rows", 65, array + "65x4 taxels at 5 mm"},
      {"pitch_mm", Json::array({4}), pitch + "[4]"},
      {"pitch_mm", Json{4, 2, 1}, pitch + "[4,2,1]"},
      {"pitch_mm", "4", pitch + "\"4\""},
      {"pitch_mm", Json{4, 0}, array + "3x4 taxels at 4 x 0 mm"},
      {"pitch_mm", Json{4, 200}, array + "3x4 taxels at 4 x 200 mm"},
      {"rows", "3", "\"rows\" must be a whole number, found \"3\""},
      {"pressed", "up", "\"pressed\" must be one of higher, lower, found \"up\""},
      {"range", Json{900, 40}, "\"range\" must be [low, high], the lower first, found [900,40]"},
      {"range", Json{900, 900.001},
       "\"range\" must be two numbers within 1e9, apart by at least 1e-5 of the larger, found 900 to "
       "900.001"},
      {"range", nullptr, "has no \"range\": expected [rest, pressed hard] of a signal that rises"},
      {"rate_hz", 0.5, "\"rate_hz\" must be 1 to 100000, found 0.5"},
      {"pich_mm", 5,
       "knows no key 'pich_mm'; it may have name, rows, columns, channels, pitch_mm, unit, pressed, range, "
       "rate_hz, port, frame, body, order, dead, rest, gain, follow_rest_s, rest_order"},
      {"frame", nullptr, "has no \"frame\", such as {\"kind\": \"text\"}; supertac-stream --probe finds it"},
      {"frame.kind", "csv", "\"frame.kind\" must be one of board, text, json, binary, found \"csv\""},
      {"frame.kind", "board", "knows no key 'frame.separator'; it may have kind"},
      {"frame.separator", ", ", "\"frame.separator\" must be one character, found \", \""},
      {"frame.skip", Json{0}, "\"frame.skip\" must be other columns than that of time, found one twice"},
      {"frame.time", Json{{"column", 0}, {"unit", "minutes"}},
       "\"frame.time.unit\" must be one of s, ms, us, ns, found \"minutes\""},
      {"frame", Json{{"kind", "binary"}},
       "\"frame.header\" must be at least a byte where there is neither trailer nor checksum, found nothing"},
      {"frame", Json{{"kind", "binary"}, {"header", "A5 5"}},
       "\"frame.header\" must be bytes as hexadecimal digits, such as \"AA55\", found \"A5 5\""},
      {"frame", Json{{"kind", "binary"}, {"header", "A5"}, {"type", "u24"}},
       "\"frame.type\" must be u8, i8, u16, i16, u32, i32 or f32, found 'u24'"},
      {"frame", Json{{"kind", "binary"}, {"header", "A5"}, {"checksum", "md5"}},
       "\"frame.checksum\" must be one of none, sum8, xor8, sum16, crc8, crc16-modbus, crc16-ccitt, "
       "crc16-xmodem, crc32, found 'md5'"},
      {"frame", Json{{"kind", "binary"}, {"header", "A5"}, {"checksum", {{"kind", "crc8"}, {"from", 2}}}},
       "\"frame.checksum.from\" must be 0 to 1, within the header or right behind it, found 2"},
      {"frame", Json{{"kind", "binary"}, {"header", "A5"}, {"fields", {{{"values", 8}}, "time"}}},
       "\"frame.fields\" must be the frame's 12 values, found 8"},
      {"frame", Json{{"kind", "binary"}, {"header", "A5"}, {"fields", {{{"values", 12}}, "time"}}},
       "\"frame.fields\" must be time once where there is frame.time, and nowhere else, found 1 times"},
      {"frame", Json{{"kind", "binary"}, {"header", "A5"}, {"fields", {{{"values", 12}, {"skip", 1}}}}},
       "\"frame.fields\" must be a list of \"time\", {\"values\": N}, {\"skip\": BYTES} and "
       "{\"counter\": \"u8\"}, in turn, found {\"values\":12,\"skip\":1}"},
      {"order", Json{0, 1, 2},
       "\"order\" must be row-major, column-major, or for each of the 12 taxels its place in the frame, "
       "from 0 and each once, -1 where there is none, found 3 places, 3 different"},
      {"dead", Json{12}, "\"dead\" must be taxels 0 to 11, found 12"},
      {"rest", Json{40, 41}, "\"rest\" must be a number for each of the 12 signals, found 2"},
      {"rest", Json{"40"}, "\"rest\" must be a list of numbers, found [\"40\"]"},
      {"rest", 40, "\"rest\" must be a list of numbers, found 40"},
      {"gain", Json{1, 1}, "\"gain\" must be a number for each of the 12 signals, found 2"},
      {"gain", 1, "\"gain\" must be a list of numbers, found 1"},
      {"gain", gains, "\"gain\" must be numbers of 0.01 to 100, found 0"},
      {"follow_rest_s", 0.5, "\"follow_rest_s\" must be 1 to 3600, found 0.5"},
      {"follow_rest_s", "5", "\"follow_rest_s\" must be a number, found \"5\""},
      {"name", "a\nb", "\"name\" must be 1 to 200 printable characters, found 'a?b'"},
      {"body", Json{{"shape", "round"}},
       "\"body.shape\" must be one of flat, dome, cylinder, found \"round\""},
      {"body", Json{{"radius_mm", 5}},
       "\"body.radius_mm\" must be given where the shape is dome or cylinder, and nowhere else, found 5"},
      {"body", Json{{"shape", "dome"}},
       "\"body.radius_mm\" must be given where the shape is dome or cylinder, and nowhere else, found 0"},
      {"body", Json{{"creep", 0.1}}, "\"body.creep_s\" must be given with creep, and not without, found 0"},
      {"body", Json{{"knee", 0.001}}, "\"body.knee\" must be 0.01 to 1000, found 0.001"},
      {"body", Json{{"uncertainty", {{"knee", 0.1}}}},
       "\"body.knee\" must be given where its uncertainty is, found 0"},
      {"body", Json{{"skin_mm", -1}}, "\"body.skin_mm\" must be 0.01 to 100, found -1"},
      {"body", Json{{"uncertainty", {{"shape", 1}}}},
       "\"body.uncertainty\" must name what a fit finds (skin_mm, knee, crosstalk_rows, crosstalk_columns, "
       "hysteresis_s, creep, creep_s, noise), found 'shape'"}};
  for (const auto& [key, value, message] : cases)
    EXPECT_EQ(what_of<FileError>([&] { changed(key, value); }), "mat.json: " + message);
}

TEST(Sensor, ArrangesTheTaxelsAndFillsTheSilentFromTheirNeighbours) {
  Sensor cross;
  cross.array = {.rows = 3, .columns = 3, .pitch_mm = 5, .channels = 2};
  cross.order = {-1, 3, -1, 1, 0, 2, -1, 4, -1};
  cross.frame.kind = FrameKind::text;
  cross.check();
  EXPECT_EQ(cross.values(), 10U);
  EXPECT_EQ(cross.silent(), (std::vector{0, 2, 6, 8}));
  const std::vector<float> frame = {0, 100, 1, 101, 2, 102, 3, 103, 4, 104};
  std::vector<float> signals(18);
  cross.arrange(frame, signals);
  EXPECT_EQ(signals[8], 0);               // the centre
  EXPECT_EQ(signals[2], 3);               // row 0, column 1
  EXPECT_EQ(signals[3], 103);             //
  EXPECT_FLOAT_EQ(signals[0], 4.0F / 3);  // the mean of 0, 1 and 3 around it
}

TEST(Sensor, TaxelsOfOtherRestAndGainAreMadeAlike) {
  Sensor mat = sensor_of_json(kMat, "mat.json"), offset = mat;
  for (int k = 0; k < 12; ++k) offset.rest.push_back(static_cast<float>(30 + 2 * k));
  for (int k = 0; k < 12; ++k) offset.gain.push_back(k % 2 == 0 ? 0.5F : 4);
  std::vector<float> frame, moved, signals(12), of_moved(12);
  for (int k = 0; k < 12; ++k) frame.push_back(static_cast<float>(40 + 7 * k));
  mat.arrange(frame, signals);
  for (std::size_t k = 0; k < 12; ++k) {  // column-major
    const std::size_t place = k % 3 * 4 + k / 3;
    moved.push_back((frame[k] - 40) / offset.gain[place] + offset.rest[place]);
  }
  offset.arrange(moved, of_moved);
  EXPECT_EQ(of_moved, signals) << "the dead taxel as well, from its neighbours";
  mat.gain.assign(12, 0.5F);  // from the end of the range where none says where it rests
  mat.arrange(frame, of_moved);
  for (std::size_t k = 0; k < 12; ++k) EXPECT_EQ(of_moved[k], 40 + (signals[k] - 40) / 2) << k;
}

TEST(Sensor, RestGainAndDeadFollowTheirTaxels) {
  Json mat = Json::parse(kMat);
  mat["rows"] = 2, mat["columns"] = 3, mat["channels"] = 1, mat.erase("order");
  mat["dead"] = {2}, mat["rest"] = {40, 41, 42, 43, 44, 45}, mat["gain"] = {1, 2, 3, 4, 5, 6};
  const Sensor before = sensor_of_json(mat.dump(), "mat.json");
  mat = Json::parse(json_of(before).dump());
  EXPECT_EQ(mat["rest_order"], "row-major");
  mat["order"] = {0, 1, 2, 5, 4, 3};
  const Sensor after = sensor_of_json(mat.dump(), "mat.json");
  EXPECT_EQ(after.rest, (std::vector<float>{40, 41, 42, 45, 44, 43}));
  EXPECT_EQ(after.gain, (std::vector<float>{1, 2, 3, 6, 5, 4}));
  EXPECT_EQ(after.dead, std::vector{2});
  EXPECT_EQ(sensor_of_json(json_of(after).dump(), "mat.json"), after) << "it says in which order they are";
  mat["order"] = {5, 4, 2, 3, 1, 0}, mat["dead"] = {0};
  EXPECT_EQ(sensor_of_json(mat.dump(), "mat.json").dead, std::vector{5});
  mat["order"] = {0, 1, 2, 3, 4, -1}, mat["rest_order"] = {0, 1, 2, 3, -1, -1};
  EXPECT_ERROR((void)sensor_of_json(mat.dump(), "mat.json"), FileError,
               "the taxel that a frame sends as 4, found none: probe the rests again");
  mat.erase("rest_order"), mat["order"] = {0, 1, 2, 5, 4, 3};
  EXPECT_EQ(sensor_of_json(mat.dump(), "mat.json").rest, before.rest) << "old files list them as they stand";
}

TEST(Sensor, MutatedFilesAreTakenOrRefusedInOneLine) {
  std::mt19937 random(1);
  Json mat = Json::parse(kMat);
  for (int k = 0; k < 12; ++k) mat["rest"].push_back(40 + k), mat["gain"].push_back(1 + 0.05 * k);
  mat["follow_rest_s"] = 12.5;
  const std::string whole = mat.dump();
  std::size_t taken = 0;
  const int count = mutations(500);
  for (int n = 0; n < count; ++n) {
    std::string text = whole;
    for (unsigned change = 0; change <= random() % 3; ++change) {
      const std::size_t at = random() % text.size();
      if (random() % 3 == 0)
        text.erase(at, 1 + random() % 8);
      else if (random() % 2 == 0)
        text[at] = static_cast<char>(random() % 256);
      else
        text.insert(at, text.substr(random() % text.size(), random() % 12));
      if (text.empty()) text = "{";
    }
    try {
      sensor_of_json(text, "mat.json").check();
      ++taken;
    } catch (const FileError& error) {
      EXPECT_TRUE(std::string(error.what()).starts_with("mat.json: "));
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
    }
  }
  EXPECT_GT(taken, 0U);
  EXPECT_LT(taken, static_cast<std::size_t>(count) / 2);
}

TEST(FrameLoad, AddsSharesOfTheRangeAndCountsItsEnds) {
  const SignalScale counts{"counts", 40, -860};  // 40 at rest, 900 pressed hard
  const std::vector<float> frame{40, 470, 900, 950, 40, 0};
  const FrameLoad load = load_of(frame, 1, counts);
  EXPECT_NEAR(load.total_force, 0.5 + 1 + 910.0 / 860 - 40.0 / 860, 1e-12);
  EXPECT_EQ(load.saturated, 2U);
  const SignalScale newtons{"N", 0, -2};  // of three axes
  const FrameLoad of_three = load_of(std::vector<float>{0, 0.6F, 0.8F, -2, 0, 0}, 3, newtons);
  EXPECT_NEAR(of_three.total_force, 0.5 + 1, 1e-7);
  EXPECT_EQ(of_three.saturated, 1U);
}

const TaxelArray kTwo = {.rows = 2, .columns = 2, .pitch_mm = 5};

Sensor with_body(const std::string& body) {
  return sensor_of_json(
      R"({"rows": 2, "columns": 2, "pitch_mm": 5, "frame": {"kind": "text"}, "body": )" + body + "}",
      "mat.json");
}

TEST(Body, IsFlatUnlessTheFileSaysOtherwiseAndOfTheRigADome) {
  EXPECT_EQ(read_sensor("rig").body, Body::of_rig());
  EXPECT_FALSE(json_of(Sensor{}).contains("body"));
  EXPECT_EQ(with_body("{}").body, Body{});
  EXPECT_FALSE(json_of(with_body("{}")).contains("body"));
  const Sensor sensor = with_body(
      R"({"shape": "cylinder", "radius_mm": 20, "skin_mm": 3, "taxel_mm": 4, "knee": 0.5, "crosstalk_rows": 0.2,
          "hysteresis_s": 0.1, "creep": 0.2, "creep_s": 3, "noise": 0.01, "uncertainty": {"knee": 0.1}})");
  EXPECT_EQ(sensor_of_json(json_of(sensor).dump(), "again").body, sensor.body);
  EXPECT_DOUBLE_EQ(sensor.body.depth_mm(2, 7), 0.1);  // 4 / 40, whatever y
  EXPECT_DOUBLE_EQ(sensor.body.sigma_mm(), std::sqrt(1.5 * 1.5 + 16.0 / 12));
  EXPECT_DOUBLE_EQ(Body::of_rig().depth_mm(3, 4), 25.0 / 94);
}

TEST(BodyResponse, SaturatesAtItsKneeAndIsOddForAxes) {
  BodyResponse response({.knee = 0.5}, kTwo);
  std::vector<double> shares = {0.5, 1, -1, 0};
  response(1, shares);
  EXPECT_DOUBLE_EQ(shares[0], 0.75);  // half of 1.5, the most it shows
  EXPECT_DOUBLE_EQ(shares[1], 1);
  EXPECT_DOUBLE_EQ(shares[2], -1);
  EXPECT_DOUBLE_EQ(shares[3], 0);
}

TEST(BodyResponse, LetsGoSlowlyAndCreeps) {
  BodyResponse slow({.knee = {}, .hysteresis_s = 2}, kTwo),
      creeping({.knee = {}, .creep = 0.5, .creep_s = 4}, kTwo);
  std::vector<double> none(4), pressed(4, 1.0), let_go(4);
  slow(1, none), slow(1, pressed);
  EXPECT_DOUBLE_EQ(pressed[0], 1) << "at once";
  slow(2, let_go);
  EXPECT_NEAR(let_go[0], std::exp(-1.0), 1e-12);
  none.assign(4, 0), pressed.assign(4, 1);
  creeping(1, none), creeping(1e-9, pressed);
  EXPECT_NEAR(pressed[0], 1, 1e-6);
  pressed.assign(4, 1), creeping(4, pressed);
  EXPECT_NEAR(pressed[0], 1 + 0.5 * (1 - std::exp(-1.0)), 1e-6);
}

TEST(BodyResponse, CrosstalkRunsAlongRowsAndColumns) {
  BodyResponse response({.knee = {}, .crosstalk_rows = 0.2, .crosstalk_columns = 0.4}, kTwo);
  std::vector<double> shares = {1, 0, 0, 0};
  response(1, shares);
  EXPECT_DOUBLE_EQ(shares[0], 1.3);
  EXPECT_DOUBLE_EQ(shares[1], 0.1);
  EXPECT_DOUBLE_EQ(shares[2], 0.2);
  EXPECT_DOUBLE_EQ(shares[3], 0);
  EXPECT_TRUE(BodyResponse({.skin_mm = 2, .knee = {}, .noise = 0.1}, kTwo).neutral());
}

}  // namespace supertac::sensor_test
