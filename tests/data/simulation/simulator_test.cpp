#include "data/simulation/simulator.h"

#include <cstdio>

#include "tests/support/test.h"

namespace supertac::simulator_test {

struct Term {
  const char* name;
  void (*leave_out)(SimulatorSettings&);
};
constexpr Term kTerms[] = {
    {"mount", [](SimulatorSettings& s) { s.mount_stiffness = 1e12; }},
    {"pad", [](SimulatorSettings& s) { s.body.skin_mm = 0.6; }},
    {"dome", [](SimulatorSettings& s) { s.body.shape = BodyShape::flat, s.body.radius_mm = 0; }},
    {"edges", [](SimulatorSettings& s) { s.with_edges = false; }},
    {"tilt", [](SimulatorSettings& s) { s.tilt_spread = 0; }},
    {"gains", [](SimulatorSettings& s) { s.with_gains = false; }},
    {"variation", [](SimulatorSettings& s) { s.with_variation = false; }},
    {"vibration", [](SimulatorSettings& s) { s.vibration_mm = 0; }},
    {"drift", [](SimulatorSettings& s) { s.drift_volts_per_s = 0; }},
    {"emi", [](SimulatorSettings& s) { s.emi_volts = 0; }},
    {"noise", [](SimulatorSettings& s) { s.noise_volts = 0; }},
    {"adc", [](SimulatorSettings& s) { s.with_adc = false; }},
    {"filter", [](SimulatorSettings& s) { s.filter_s = 0; }},
    {"saturation", [](SimulatorSettings& s) { s.with_saturation = false; }},
    {"jitter", [](SimulatorSettings& s) { s.jitter_s = 0; }},
    {"loss", [](SimulatorSettings& s) { s.lost_fraction = 0; }},
};

SimulatorSettings without(std::string_view name, SimulatorSettings settings = {}) {
  for (const Term& term : kTerms)
    if (name == term.name) term.leave_out(settings);
  return settings;
}

SimulatorSettings clean() {
  SimulatorSettings settings;
  for (const Term& term : kTerms) term.leave_out(settings);
  return settings;
}

double deepest(const Recording& recording, int taxel) {
  float lowest = 9;
  for (std::size_t i = 0; i < recording.frames(); ++i)
    lowest = std::min(lowest, recording.signals[i * rig::kTaxels + static_cast<std::size_t>(taxel)]);
  return 2.442 - lowest;
}

// Root of the mean squared difference, in mV, over passes that differ in nothing but a term.
double rms_change_mv(const char* term) {
  double sum = 0, n = 0;
  for (const char* plate : {"bumps12", "ridges6"})
    for (const int pass : {1, 4}) {
      const SimulatorSettings with = without("loss");  // frames must correspond
      const Recording a = simulate_pass(Plate::named(plate), {.pass = pass}, with);
      const Recording b = simulate_pass(Plate::named(plate), {.pass = pass}, without(term, with));
      for (std::size_t i = 0; i < a.signals.size(); ++i)
        sum += std::pow(a.signals[i] - b.signals[i], 2), n += 1;
    }
  return 1000 * std::sqrt(sum / n);
}

TEST(Simulator, SameSeedSameRecordingOtherSeedOther) {
  const Plate plate = Plate::named("ridges6");
  const Recording a = simulate_pass(plate, {.pass = 3}), b = simulate_pass(plate, {.pass = 3});
  EXPECT_EQ(a.time_s, b.time_s);
  EXPECT_EQ(a.signals, b.signals);
  EXPECT_NE(a.signals, simulate_pass(plate, {.pass = 3}, {}, 2).signals);
  EXPECT_NE(a.signals, simulate_pass(plate, {.pass = 4}).signals);
}

TEST(Simulator, AnyArrayFeelsTheRidgeWhereItIs) {
  SimulatorSettings settings = clean();
  const Plate plate("one", {{"ridges", 40, 2.5}});
  for (const auto& [array, tolerance] :
       {std::pair(TaxelArray{}, 0.1), {{.rows = 6, .columns = 3, .pitch_mm = 2}, 0.15}}) {
    settings.array = array;
    const Recording r = simulate_pass(plate, {.pass = 4}, settings);
    EXPECT_EQ(r.array, array);
    const std::size_t signals = array.signals();
    ASSERT_EQ(r.signals.size(), r.frames() * signals);
    for (std::size_t k = 0; k < signals; ++k) {
      std::size_t at = 0;
      for (std::size_t i = 0; i < r.frames(); ++i)
        if (r.signals[i * signals + k] < r.signals[at * signals + k]) at = i;
      EXPECT_NEAR(r.position_mm[2 * at + 1] + array.y_mm(static_cast<int>(k)), plate.crests()[0], tolerance)
          << array.text() << ", taxel " << k;
    }
  }
  // A taxel far outside of the rig's pad still has points to feel with.
  settings.array = {.rows = 16, .columns = 16, .pitch_mm = 5};
  for (const double v : FingerModel(plate, settings).volts({.x_mm = 18, .y_mm = 54, .z_mm = -1}, 0))
    EXPECT_TRUE(std::isfinite(v));
  settings.array.channels = 2;
  EXPECT_REFUSAL(
      "simulator: array expects one channel or three axes, got 16x16 taxels at 5 mm with 2 channels",
      simulate_pass(plate, {}, settings));
}

TEST(Simulator, ThreeAxesAreWhereTheLoadLeansAndTheLoad) {
  SimulatorSettings settings = clean();
  settings.body.skin_mm = SimulatorSettings().body.skin_mm;
  settings.array = {.rows = 3, .columns = 1, .pitch_mm = 2};
  const Plate plate("one", {{"ridges", 40, 2.5}});
  const FingerModel one(plate, settings);
  settings.array.channels = 3;
  const FingerModel three(plate, settings);
  const FingerPose pose{
      .x_mm = 18, .y_mm = plate.crests()[0], .z_mm = 2.4};  // the ridge under the middle row
  const std::vector<double> load = one.volts(pose, 0), axes = three.volts(pose, 0);
  ASSERT_EQ(axes.size(), 9U);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(axes[3 * k + 2], load[k]) << k;
  const auto y = [&](std::size_t row) { return axes[3 * row + 1]; };
  EXPECT_NEAR(axes[3], axes[0], 1e-9) << "nothing leans along a ridge";
  EXPECT_LT(y(0), axes[0]) << "the ridge lies behind the first row";
  EXPECT_GT(y(2), axes[0]);
  const double drop = one.volts({.x_mm = 18, .y_mm = 54, .z_mm = 10}, 0)[0] - load[0];
  EXPECT_NEAR(y(0) + y(2) - 2 * axes[0], 2 * 0.3 * drop, 1e-9) << "the skin is dragged";
}

// What a threshold takes from a taxel grows with its load up to that threshold and stays there.
TEST(Simulator, AThresholdTakesNoMoreThanItself) {
  SimulatorSettings settings = clean();
  const Plate plate = Plate::named("plain");
  const FingerModel every(plate, settings);
  settings.threshold_mm = 0.1;
  const FingerModel deaf(plate, settings);
  const std::vector<double> rest = deaf.volts({.x_mm = 18, .y_mm = 54, .z_mm = 5}, 0);
  std::vector<double> taken(rig::kTaxels), before;
  std::vector<int> silent(rig::kTaxels);
  for (const double z : {0.0, -0.02, -0.05, -0.1, -0.3, -1.0, -2.0, -2.5}) {
    const FingerPose pose{.x_mm = 18, .y_mm = 54, .z_mm = z};
    const auto all = every.volts(pose, 0), some = deaf.volts(pose, 0);
    before = taken;
    for (std::size_t k = 0; k < taken.size(); ++k) {
      taken[k] = some[k] - all[k];
      EXPECT_GE(taken[k], before[k] - 1e-12) << k << " at " << z;
      if (all[k] < rest[k] && some[k] == rest[k]) ++silent[k];
    }
  }
  EXPECT_GT(std::ranges::count_if(silent, [](int n) { return n > 0; }), rig::kTaxels / 2);
  for (std::size_t k = 0; k < taken.size(); ++k) {  // pressed harder still, nothing more is taken
    EXPECT_NEAR(taken[k], before[k], 1e-12) << k;
    EXPECT_GT(taken[k], 0) << k;
  }
}

// Without pad, dome and mount a taxel feels the plate where it is: the mean over the taxels is the height,
// the difference of rows (columns) 9 mm apart the slope along (across).
TEST(Simulator, AFingerThatWandersRocksAsMuchAsSaid) {
  SimulatorSettings settings = clean();
  settings.indentation_mm = 2;  // never lets go
  settings.rate_hz = 30;
  const Plate plate = Plate::named("plain");
  const auto deviations = [&](double wander) {
    settings.wander = wander;
    double height = 0, across = 0, along = 0, n = 0;
    for (std::uint64_t seed = 1; seed <= 30; ++seed) {
      const Recording r = simulate_pass(plate, {.pass = 4, .from_mm = 20, .to_mm = 100}, settings, seed);
      for (std::size_t i = 0; i < r.frames(); i += 3) {
        if (r.lift_mm[i] > 0) continue;
        double mean = 0, rise_along = 0, rise_across = 0;
        for (std::size_t k = 0; k < rig::kTaxels; ++k) {
          const double load =
              (rig::kRestVolts - r.signals[i * rig::kTaxels + k]) / settings.volts_per_load / 0.5;
          mean += load / rig::kTaxels;
          rise_along += load / 4 * ((k / 4 == 3) - (k / 4 == 0));
          rise_across += load / 4 * ((k % 4 == 3) - (k % 4 == 0));
        }
        height += std::pow(mean - settings.indentation_mm, 2), ++n;
        along += std::pow(rise_along, 2), across += std::pow(rise_across, 2);
      }
    }
    return std::vector<double>{std::sqrt(height / n), std::sqrt(along / n), std::sqrt(across / n)};
  };
  for (const double still : deviations(0)) EXPECT_LT(still, 1e-6);
  constexpr double kWander = 0.04, kDeviation = 0.85;
  const std::vector<double> rocks = deviations(kWander);
  EXPECT_NEAR(rocks[0], kWander * kDeviation * 4, 0.03);
  EXPECT_NEAR(rocks[1], kWander * kDeviation * 9, 0.06);
  EXPECT_NEAR(rocks[2], kWander * kDeviation * 9, 0.06);
}

TEST(Simulator, FourPhases) {
  // Without variation the finger presses the flat plate, as half of the rig's passes do.
  const Recording r =
      simulate_pass(Plate::named("plain"), {.pass = 4}, without("variation", without("loss")));
  const auto y = [&](std::size_t i) { return r.position_mm[2 * i + 1]; };
  const std::size_t n = r.frames();
  // 1 s down, 108 mm at 10 mm/s, 1 s up, 108 mm back at 50 mm/s
  EXPECT_NEAR(static_cast<double>(n), 300 * (1 + 10.8 + 1 + 2.16), 30);
  const auto lift = [&](std::size_t i) { return r.lift_mm[i]; };
  EXPECT_EQ(y(0), 0);
  EXPECT_EQ(y(290), 0);  // onset: comes down in place
  EXPECT_EQ(lift(0), 5);
  EXPECT_NEAR(lift(150), 2.5, 0.1);
  EXPECT_NEAR(y(300 + 1620), 54, 0.1);  // slides
  EXPECT_EQ(lift(300 + 1620), 0);
  EXPECT_NEAR(y(300 + 3240 + 150), 108, 1e-4);  // release
  EXPECT_NEAR(lift(300 + 3240 + 150), 2.5, 0.1);
  EXPECT_NEAR(y(n - 1), 0, 0.5);  // re-position: back, and on to the next pass, in the air
  EXPECT_EQ(lift(n - 1), 5);
  EXPECT_NEAR(r.position_mm[2 * (n - 1)], rig::pass_x_mm(5), 0.1);
  EXPECT_GT(deepest(r, 5), 0.005);  // the flat plate is touched
}

TEST(Simulator, ResemblesTheRig) {
  const Recording middle = simulate_pass(Plate::named("3_Bumps"), {.pass = 4});
  EXPECT_GT(deepest(middle, 4), 0.2);
  EXPECT_GT(deepest(middle, 15), 0.15);
  EXPECT_LT(deepest(middle, 2), 0.15);
  const Recording side =
      simulate_pass(Plate::named("3_Bumps"), {.pass = 1});  // half the finger beside the plate
  EXPECT_GT(deepest(side, 7), 4 * deepest(side, 4));
  for (const float v : middle.signals) {
    EXPECT_GE(v, 2.091F);
    EXPECT_LE(v, 2.46F);
  }
}

// Prints the table of docs/import.md.
TEST(Simulator, EveryTermChangesSomething) {
  for (const auto& [term, leave_out] : kTerms) {
    if (std::string_view(term) == "loss") continue;
    const double change = rms_change_mv(term);
    std::printf("| %s | %.2f |\n", term, change);
    EXPECT_GT(change, 0.01) << term;
  }
}

TEST(Simulator, LossLeavesGapsInTheStampsNotInTheOrder) {
  SimulatorSettings settings;
  settings.lost_fraction = 0.3;
  const Recording r = simulate_pass(Plate::named("bumps6"), {}, settings);
  EXPECT_LT(r.frames(), 3300u);
  EXPECT_EQ(r.signals.size(), r.frames() * rig::kTaxels);
  EXPECT_EQ(r.position_mm.size(), r.frames() * 2);
  EXPECT_EQ(r.lift_mm.size(), r.frames());
  for (std::size_t i = 1; i < r.frames(); ++i) EXPECT_GT(r.time_s[i], r.time_s[i - 1]);
}

TEST(Simulator, RefusesImpossiblePasses) {
  const Plate plate = Plate::named("plain");
  const std::tuple<PassSettings, double, std::string> cases[] = {
      {{.speed_mm_s = 0}, 300, "speed_mm_s expects a finite number above 0, got 0"},
      {{}, -1, "rate_hz expects a finite number above 0, got -1"},
      {{.from_mm = -1}, 300, "from_mm expects 0 to below 108, got -1"},
      {{.from_mm = 80, .to_mm = 28}, 300, "to_mm expects above from_mm, 80, to 108, got 28"},
      {{.to_mm = 120}, 300, "to_mm expects above from_mm, 0, to 108, got 120"},
      {{.pass = 9}, 300, "pass expects 1 to 8, got 9"},
      {{.trial = 0}, 300, "trial expects 1 or more, got 0"}};
  SimulatorSettings settings;
  for (const auto& [pass, rate_hz, refusal] : cases) {
    settings.rate_hz = rate_hz;
    EXPECT_REFUSAL("simulate_pass: " + refusal, simulate_pass(plate, pass, settings));
  }
}

TEST(FingerModel, TheMountLiftsTheOtherRowsOffThePlate) {
  const Plate plate("one", {{"bumps", 40, 2.5}});
  SimulatorSettings yielding = clean();
  yielding.mount_stiffness = SimulatorSettings().mount_stiffness;
  const double y_mm = plate.crests()[0] - TaxelArray{}.y_mm(12);  // row 3 on the bump
  const auto drop = [&](const SimulatorSettings& settings, double at_y_mm, std::size_t taxel) {
    const FingerPose pose{.x_mm = 18, .y_mm = at_y_mm, .z_mm = -0.35};
    return rig::kRestVolts - FingerModel(plate, settings).volts(pose, 0)[taxel];
  };
  EXPECT_GT(drop(clean(), y_mm, 0), 0.045);
  EXPECT_EQ(drop(yielding, y_mm, 0), 0);
  EXPECT_GT(drop(yielding, y_mm, 12), 0.045);
  EXPECT_GT(drop(yielding, 20, 0), 0.0045);
}

}  // namespace supertac::simulator_test
