#include "data/simulation/fit.h"

#include <nlohmann/json.hpp>

#include "data/simulation/presses.h"
#include "io/numbers/random.h"
#include "tests/support/test.h"

namespace supertac::fit_test {

Sensor mat_to_fit() {
  Sensor sensor;
  sensor.array = {.rows = 6, .columns = 10, .pitch_mm = 8, .channels = 1};
  sensor.scale = {.unit = "counts", .rest = 40, .span = -860};
  sensor.rate_hz = 40;
  sensor.body = {};
  return sensor;
}

// Bodies that the fit has not seen: drawn by other numbers than its own.
TEST(BodyFit, FindsKnownBodiesWithinTheStatedUncertainty) {
  const RandomStream random(77, 1);
  int told = 0, within = 0, farther = 0;
  std::map<std::string, int> of;
  const BodyFitter fitter(mat_to_fit(), 1);
  constexpr std::uint64_t kBodies = 12;
  for (std::uint64_t i = 0; i < kBodies; ++i) {
    Sensor truth = mat_to_fit();
    truth.body.skin_mm = 8 * std::lerp(0.4, 1.4, random.uniform(10 * i));
    truth.body.knee = std::lerp(0.3, 3.0, random.uniform(10 * i + 1));
    truth.body.crosstalk_rows = 0.4 * random.uniform(10 * i + 2);
    truth.body.crosstalk_columns = 0.4 * random.uniform(10 * i + 3);
    truth.body.hysteresis_s = std::lerp(0.02, 0.5, random.uniform(10 * i + 4));
    truth.body.creep = 0.3 * random.uniform(10 * i + 5), truth.body.creep_s = 3;
    truth.body.noise = 0.004;
    const BodyFit fit = fitter(simulate_touching(truth, 30, 1000 + i));
    EXPECT_NEAR(fit.sensor.body.noise, 0.004, 0.001);
    for (const FittedNumber& number : fit.numbers) {
      if (!number.told) continue;
      ++told, ++of[number.key];
      for (const auto& [key, member] : fitted_numbers())
        if (key == number.key) {
          const double off = std::abs(truth.body.*member - number.value) / number.deviation;
          within += off<2, farther += off> 4;
        }
    }
  }
  EXPECT_GE(of["skin_mm"], 8);
  EXPECT_EQ(of["crosstalk_rows"], 12);
  EXPECT_EQ(of["crosstalk_columns"], 12);
  EXPECT_GE(told, 44);
  EXPECT_GE(within, 0.8 * told) << told;
  EXPECT_LE(farther, 1);

  // Once more with what was found: the rests are those of the recording still, and so is a skin that was
  // known.
  Sensor uneven = mat_to_fit();
  uneven.body.skin_mm = 6;
  Recording touched = simulate_touching(uneven, 30, 5);
  uneven.rest.assign(60, 50);
  touched.metadata["rest"] = nlohmann::json(uneven.rest).dump();
  const BodyFit once = BodyFitter(uneven, 1)(touched), again = BodyFitter(once.sensor, 1)(touched);
  for (const float rest : once.sensor.rest) EXPECT_NEAR(rest, 50, 2);
  EXPECT_EQ(again.sensor, once.sensor);
  EXPECT_EQ(once.sensor.body.skin_mm, 6);
  EXPECT_FALSE(once.sensor.body.uncertainty.contains("skin_mm"));
  EXPECT_EQ(once.lines()[1], "skin_mm 6.000 +- 0.00");

  Sensor slow = mat_to_fit();
  slow.rate_hz = 1;
  EXPECT_EQ(what_of<std::runtime_error>([&] { BodyFitter(slow, 1); }),
            "a body cannot be fitted to 1 frames a second: of half a minute too few would be touched; leave "
            "the fit out, and presses are simulated of bodies as different as arrays are");

  Recording still = simulate_touching(mat_to_fit(), 10, 1);
  for (float& signal : still.signals) signal = 40;
  EXPECT_EQ(what_of<std::runtime_error>([&] { fitter(still); }),
            "too little was pressed: expected 100 frames or more in which a taxel shows 8 % of the range; "
            "press here "
            "and there for half a minute, or let the probe find the range");
}

}  // namespace supertac::fit_test
