#include "data/sensors/body.h"

#include <nlohmann/json.hpp>

#include "data/sensors/sensor.h"
#include "tests/support/test.h"

namespace supertac::body_test {

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

TEST(Body, RefusalsNameTheKey) {
  const std::pair<const char*, const char*> cases[] = {
      {R"({"shape": "round"})", "\"body.shape\" must be one of flat, dome, cylinder, found \"round\""},
      {R"({"radius_mm": 5})",
       "\"body.radius_mm\" must be given where the shape is dome or cylinder, and nowhere "
       "else, found 5"},
      {R"({"shape": "dome"})",
       "\"body.radius_mm\" must be given where the shape is dome or cylinder, and nowhere "
       "else, found 0"},
      {R"({"creep": 0.1})", "\"body.creep_s\" must be given with creep, and not without, found 0"},
      {R"({"knee": 0.001})", "\"body.knee\" must be 0.01 to 1000, found 0.001"},
      {R"({"uncertainty": {"knee": 0.1}})", "\"body.knee\" must be given where its uncertainty is, found 0"},
      {R"({"skin_mm": -1})", "\"body.skin_mm\" must be 0.01 to 100, found -1"},
      {R"({"uncertainty": {"shape": 1}})",
       "\"body.uncertainty\" must name what a fit finds (skin_mm, knee, crosstalk_rows, crosstalk_columns, "
       "hysteresis_s, creep, creep_s, noise), found 'shape'"}};
  for (const auto& [body, message] : cases)
    EXPECT_NE(what_of<FileError>([&] { with_body(body); }).find(message), std::string::npos)
        << what_of<FileError>([&] { with_body(body); });
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

}  // namespace supertac::body_test
