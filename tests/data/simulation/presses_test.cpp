#include "data/simulation/presses.h"

#include "data/recordings/resample.h"
#include "tests/support/test.h"

namespace supertac::presses_test {

Sensor mat(int rows = 6, int columns = 10) {
  Sensor sensor;
  sensor.array = {.rows = rows, .columns = columns, .pitch_mm = 8, .channels = 1};
  sensor.scale = {.unit = "counts", .rest = 40, .span = -860};
  sensor.body = {.skin_mm = 6, .knee = {}, .noise = 0.002};
  return sensor;
}

TEST(Presses, EveryKindReachesTheWholeArrayAndBitsFollowFromTheSeed) {
  FeltTaxels felt;
  for (const std::string& kind : press_kinds()) {
    const Recording one = simulate_presses(mat(), {.kind = kind, .count = 40}, 3);
    EXPECT_EQ(one.frames(), std::size_t{40} * kFramesOfAPress);
    EXPECT_EQ(one.truth_height, 24);
    EXPECT_EQ(one.truth_width, 40);
    EXPECT_EQ(one.metadata.at("group"), kind);
    EXPECT_GT(*std::ranges::max_element(one.truth), 0.5F) << kind;
    EXPECT_EQ(one.signals, simulate_presses(mat(), {.kind = kind, .count = 40}, 3).signals);
    EXPECT_NE(one.signals, simulate_presses(mat(), {.kind = kind, .number = 2, .count = 40}, 3).signals);
    felt.add(one);
  }
  EXPECT_TRUE(felt.unfelt().empty());
}

// The load's total and its middle are those of the truth: nothing is mirrored, turned or lost.
TEST(Presses, SignalsLieWhereTheTruthIs) {
  Sensor sensor = mat();
  sensor.body.noise = 1e-6;
  const Recording r = simulate_presses(sensor, {.kind = "disc", .count = 600}, 5);
  const std::size_t signals = 60, pixels = 960;
  int compared = 0;
  for (std::size_t f = 0; f < r.frames(); ++f) {
    double load = 0, x = 0, y = 0, truth = 0, tx = 0, ty = 0, edge = 0;
    for (std::size_t k = 0; k < signals; ++k) {
      const double share = (r.signals[f * signals + k] - 40.0) / 860;
      load += share, x += share * static_cast<double>(k % 10), y += share * static_cast<double>(k / 10);
    }
    for (std::size_t p = 0; p < pixels; ++p) {
      const double value = double{r.truth[f * pixels + p]};
      truth += value, tx += value * (static_cast<double>(p % 40) / 4 - 0.375),
          ty += value * (static_cast<double>(p / 40) / 4 - 0.375);
      if (p % 40 < 6 || p % 40 > 33 || p / 40 < 6 || p / 40 > 17) edge += value;
    }
    if (truth < 3 || edge > 0) continue;
    ++compared;
    EXPECT_NEAR(x / load, tx / truth, 0.35) << f;
    EXPECT_NEAR(y / load, ty / truth, 0.35) << f;
    EXPECT_NEAR(load / (truth / 16), 1, 0.45) << f;  // as strong as was drawn
  }
  EXPECT_GT(compared, 20);
}

TEST(Presses, TheBodyDecides) {
  // A narrow dome is touched only where it bulges, wherever the object stands.
  Sensor dome = mat();
  dome.body.shape = BodyShape::dome, dome.body.radius_mm = 30;
  const Recording flat = simulate_presses(mat(), {.kind = "edge", .count = 60}, 1),
                  round = simulate_presses(dome, {.kind = "edge", .count = 60}, 1);
  const auto touched = [](const Recording& r) {
    return std::ranges::count_if(r.truth, [](float v) { return v > 0; });
  };
  EXPECT_LT(touched(round), touched(flat) / 2);
  // A thicker skin spreads what one taxel felt.
  Sensor thick = mat();
  thick.body.skin_mm = 16;
  const auto strongest = [](const Recording& r) { return *std::ranges::max_element(r.signals); };
  EXPECT_LT(strongest(simulate_presses(thick, {.kind = "bar", .count = 60}, 1)),
            strongest(simulate_presses(mat(), {.kind = "bar", .count = 60}, 1)));
}

// Coarse surfaces touch in few patches, fine ones in many, each much or little; and of an array without a
// skin each taxel shows the mean of the truth over its own square, as much stronger or weaker as the press
// and the taxel are.
TEST(Presses, SurfacesHaveEverySizeAndATaxelIsTheMeanOverItsSide) {
  Sensor sensor = mat();
  sensor.body = {.skin_mm = 0.01, .taxel_mm = 8, .knee = {}, .noise = 1e-6};
  const auto edges_of = [&](const std::string& kind) {  // of a row, in the mean
    const Recording r = simulate_presses(sensor, {.kind = kind, .count = 60}, 4);
    double edges = 0, frames = 0, squares = 0, off = 0, least = 1, most = 0;
    for (std::size_t f = 0; f < r.frames(); ++f) {
      const auto truth = std::span(r.truth).subspan(f * 960, 960);
      double touched = 0, load = 0, shown = 0;
      std::vector<double> means(60);
      for (std::size_t p = 0; p < 960; ++p) {
        means[p / 160 * 10 + p % 40 / 4] += double{truth[p]} / 16;
        touched += truth[p] > 0, edges += p % 40 > 0 && (truth[p] > 0) != (truth[p - 1] > 0);
      }
      if (touched == 0) continue;
      ++frames, least = std::min(least, touched / 960), most = std::max(most, touched / 960);
      for (std::size_t k = 0; k < 60; ++k)
        load += means[k], shown += (double{r.signals[f * 60 + k]} - 40) / 860;
      for (std::size_t k = 0; k < 60; ++k) {
        const double difference = (double{r.signals[f * 60 + k]} - 40) / 860 * load / shown - means[k];
        squares += means[k] * means[k], off += difference * difference;
      }
    }
    EXPECT_LT(least, 0.25) << kind;
    EXPECT_GT(most, 0.9) << kind;
    EXPECT_LT(std::sqrt(off / squares), 0.07) << kind;  // of this 0.05 are the taxels' own
    return edges / frames / 24;
  };
  EXPECT_GT(edges_of("surface1"), 8);
  EXPECT_LT(edges_of("surface7"), 4);
}

TEST(Presses, ThreeAxesLeanAndRestInTheMiddle) {
  Sensor tip = mat(3, 3);
  tip.array.channels = 3;
  const Recording r = simulate_presses(tip, {.kind = "mixed", .count = 80}, 2);
  double low = 1, high = 0;
  for (std::size_t i = 0; i < r.signals.size(); i += 3) {
    const double share = (r.signals[i] - 40.0) / 860;
    low = std::min(low, share), high = std::max(high, share);
  }
  EXPECT_LT(low, 0.4);
  EXPECT_GT(high, 0.6);
  tip.array.channels = 2;
  EXPECT_REFUSAL("presses: array expects one channel or three axes, got 3x3 taxels at 8 mm with 2 channels",
                 simulate_presses(tip, {}, 1));
  EXPECT_REFUSAL(
      "presses: kind expects one of disc, bar, ring, edge, letter, fingertip, mixed, surface1, surface2, "
      "surface3, surface4, surface5, surface6, surface7, got 'cat'",
      simulate_presses(mat(), {.kind = "cat"}, 1));
}

TEST(FeltTaxels, NamesThoseThatASimulationNeverReached) {
  Recording r;
  r.array = {.rows = 2, .columns = 3, .pitch_mm = 5};
  r.signal_scale = {.unit = "counts", .rest = 0, .span = -100};
  r.body = Body{.shape = BodyShape::dome, .radius_mm = 20, .knee = {}};
  r.source = "simulated";
  r.time_s = {0, 1};
  r.signals = {0, 0, 0, 0, 0, 0, 3, 80, 9, 4, 9, 1};
  FeltTaxels felt;
  felt.add(r);
  EXPECT_EQ(felt.unfelt(), (std::vector<int>{0, 2, 3, 4, 5}));
  EXPECT_EQ(felt.complaint(),
            "5 of 6 taxels feel nothing: 0, 2-5; a network would learn that they never do. Say in the "
            "sensor's file what shape the array has, \"body\": {\"shape\": \"flat\"}, and simulate again");
  r.signals[8] = 30;
  FeltTaxels third;
  third.add(r);
  EXPECT_EQ(third.complaint(), "") << "as of one slide of the rig's dome";
  r.source = "imported", r.signals.assign(12, 0);
  FeltTaxels real;
  real.add(r);
  EXPECT_EQ(real.complaint(), "") << "a real array may not have been pressed everywhere";
}

}  // namespace supertac::presses_test
