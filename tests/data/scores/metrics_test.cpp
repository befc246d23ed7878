#include "data/scores/metrics.h"

#include <nlohmann/json.hpp>

#include "data/plates/truth.h"
#include "io/numbers/random.h"
#include "tests/support/test.h"

namespace supertac::metrics_test {

using Image = std::vector<float>;

Image flat(float level, int size = 16) { return Image(static_cast<std::size_t>(size * size), level); }

Image noise(std::uint64_t stream, int size = 16) {
  Image image = flat(0, size);
  for (std::size_t i = 0; i < image.size(); ++i)
    image[i] = static_cast<float>(RandomStream(3, stream).uniform(i));
  return image;
}

Image plate(const char* name, double y, int size = 16) {
  Image image = flat(0, size);
  truth_image(Plate::named(name), 18, y, {size, size, 12.0 / size}, image);
  return image;
}

Image mapped(Image image, float gain, float offset) {
  for (float& v : image) v = gain * v + offset;
  return image;
}

class ScoredPairs : public ZoneMetrics {
 public:
  explicit ScoredPairs(const ImageGrid& grid = {}) : ZoneMetrics(grid) {}
  void add(std::span<const float> output, std::span<const float> truth) {
    ZoneMetrics::add(output, truth, Zone::near);  // part of all() alone
  }
  Metrics result() const { return all(); }
};

TEST(Psnr, IsTheLogarithmOfTheMeanSquaredErrorOnRangeOne) {
  EXPECT_NEAR(mean_squared_error(flat(0.5F), flat(0.25F)), 0.0625, 1e-12);
  EXPECT_NEAR(psnr_db(0.01), 20, 1e-9);
  EXPECT_NEAR(psnr_db(1), 0, 1e-9);
  EXPECT_NEAR(psnr_db(4), -6.0206, 1e-4);
}

TEST(Psnr, OfIdenticalImagesIsCapped) {
  EXPECT_EQ(psnr_db(mean_squared_error(noise(1), noise(1))), kPsnrCapDb);
  EXPECT_EQ(psnr_db(1e-30), kPsnrCapDb);
}

TEST(Psnr, PooledAndPerImageMeansDiffer) {
  ScoredPairs metrics;
  metrics.add(flat(0.1F), flat(0));    // 20 dB
  metrics.add(flat(0.001F), flat(0));  // 60 dB
  EXPECT_NEAR(metrics.result().psnr_mean_db, 40, 1e-4);
  EXPECT_NEAR(metrics.result().psnr_pooled_db, 10 * std::log10(2 / (0.01 + 1e-6)), 1e-4);
}

TEST(Ssim, OfIdenticalImagesIsOne) {
  for (const int size : {8, 16, 32}) {
    EXPECT_NEAR(ssim(noise(1, size), noise(1, size), size), 1, 1e-12);
    EXPECT_NEAR(ssim(plate("ridges6", 51, size), plate("ridges6", 51, size), size), 1, 1e-12);
  }
}

TEST(Ssim, FlatAgainstFlatIsTheLuminanceTermAlone) {
  EXPECT_NEAR(ssim(flat(0), flat(0), 16), 1, 1e-12);
  EXPECT_NEAR(ssim(flat(0.5F), flat(0.25F), 16), (2 * 0.125 + 1e-4) / (0.25 + 0.0625 + 1e-4), 1e-9);
}

TEST(Ssim, FlatAgainstTexturedIsNearZero) {
  EXPECT_LT(ssim(flat(0.5F), noise(2), 16), 0.05);
  EXPECT_GT(ssim(flat(0.5F), noise(2), 16), 0);
}

TEST(Ssim, OfAnticorrelatedImagesIsNegative) {
  EXPECT_LT(ssim(noise(2), mapped(noise(2), -1, 1), 16), -0.8);
  EXPECT_LT(ssim(noise(2, 8), mapped(noise(2, 8), -1, 1), 8), -0.8);
}

// E[x^2] - E[x]^2 in single precision comes out negative at this level.
TEST(Ssim, VariancesAreCentred) {
  EXPECT_NEAR(ssim(flat(200), flat(200), 16), 1, 1e-12);
  const double low = ssim(mapped(noise(1), 1, 0), mapped(noise(2), 1, 0), 16);
  const double high = ssim(mapped(noise(1), 1, 200), mapped(noise(2), 1, 200), 16);
  EXPECT_GT(high, -1);
  EXPECT_LT(high, 1);
  // At level 200 the luminance term is 1, so what is left is contrast and structure.
  EXPECT_NEAR(high, ssim(mapped(noise(1), 1, 20), mapped(noise(2), 1, 20), 16), 2e-3);
  EXPECT_LT(std::abs(low - high), 0.2);
}

// The constants belong to range 1: with those of range 255 any pair would score .999.
TEST(Ssim, RangeIsOne) {
  const double c2 = 0.03 * 0.03;
  Image stripes = flat(0);
  for (std::size_t i = 0; i < stripes.size(); ++i) stripes[i] = i % 2 == 0 ? 0.45F : 0.55F;
  EXPECT_LT(ssim(stripes, flat(0.5F), 16), c2 / (0.0024 + c2));
}

// Numbers of an independent NumPy implementation (explicit windows, double precision).
TEST(Ssim, AgreesWithHandComputedWindow) {
  Image a = flat(0, 8), b = flat(0, 8);
  for (std::size_t i = 0; i < 64; ++i) {
    a[i] = static_cast<float>(i % 5) / 4;
    b[i] = static_cast<float>(i * i % 7) / 6;
  }
  EXPECT_NEAR(ssim(a, b, 8), 0.047516553, 1e-6);
  Image c = flat(0), d = flat(0);
  for (std::size_t i = 0; i < 256; ++i) {
    c[i] = static_cast<float>(i % 5) / 4;
    d[i] = static_cast<float>(i * i % 7) / 6;
  }
  EXPECT_NEAR(ssim(c, d, 16), -0.084639437, 1e-6);
}

TEST(Ssim, RefusesImagesWithoutAValidPosition) {
  EXPECT_EQ(what_of<std::invalid_argument>([&] { ssim(flat(0, 2), flat(0, 2), 2); }),
            "ssim: size must be at least 3, got 2");
  EXPECT_EQ(what_of<std::invalid_argument>([&] { ssim(flat(0, 16), flat(0, 8), 16); }),
            "ssim: expects 256 pixels, got 64");
}

TEST(Contact, NeedsAPixelAboveZero) {
  Image image = flat(0);
  EXPECT_FALSE(in_contact(image));
  image[255] = 1e-6F;
  EXPECT_TRUE(in_contact(image));
}

TEST(MetricsAccumulator, OfNothingIsNull) {
  const auto json = to_json(MetricsAccumulator(ImageGrid{}).result());
  EXPECT_EQ(json["windows"], 0);
  for (const char* key :
       {"psnr_mean_db", "psnr_pooled_db", "ssim", "phase_correlation", "phase_correlation_floor",
        "position_error_px", "position_error_mm", "ghost_rate", "miss_rate"})
    EXPECT_TRUE(json.at(key).is_null()) << key;
  EXPECT_EQ(json.size(), 10U);
  Metrics metrics;
  metrics.windows = 12, metrics.ssim = 0.8125;
  EXPECT_EQ(to_json(metrics)["windows"], 12);
  EXPECT_EQ(to_json(metrics)["ssim"], 0.8125);
}

TEST(MetricsAccumulator, PerfectOutputsStandAboveTheFloor) {
  ScoredPairs metrics;
  for (int i = 0; i < 60; ++i) {
    const Image truth = plate("bumps12", 42 + 0.4 * i);
    metrics.add(truth, truth);
  }
  const Metrics m = metrics.result();
  EXPECT_EQ(m.windows, 60U);
  EXPECT_NEAR(m.ssim, 1, 1e-12);
  EXPECT_GT(m.phase_correlation, 0.9);
  EXPECT_LT(m.phase_correlation_floor, 0.8 * m.phase_correlation);
  EXPECT_NEAR(m.position_error_px, 0, 1e-3);
}

TEST(MetricsAccumulator, PositionErrorIsTheDisplacementInPixelsAndMillimetres) {
  ScoredPairs metrics;
  metrics.add(plate("bumps12", 54 - 1.5), plate("bumps12", 54));
  EXPECT_NEAR(metrics.result().position_error_px, 2, 0.2);
  EXPECT_DOUBLE_EQ(metrics.result().position_error_mm, metrics.result().position_error_px * 0.75);
}

// A collapsed network must not look as if it knew where things are.
TEST(MetricsAccumulator, MeasuresPixelsOfAnySize) {
  const ImageGrid grid{8, 24, 0.5};
  ScoredPairs metrics(grid);
  std::vector<float> truth(grid.pixels()), moved(grid.pixels());
  truth_image(Plate::named("4_Blob"), 18, 52, grid, truth);
  truth_image(Plate::named("4_Blob"), 17, 52, grid, moved);
  metrics.add(moved, truth);
  EXPECT_NEAR(metrics.result().position_error_mm, 1, 0.2);
  ScoredPairs of_flat(grid);
  of_flat.add(std::vector<float>(grid.pixels(), 0.5F), truth);
  EXPECT_EQ(of_flat.result().position_error_px, 4);  // half the shorter side
}

TEST(MetricsAccumulator, FlatOutputHasTheWorstPosition) {
  ScoredPairs metrics;
  metrics.add(flat(0), plate("bumps12", 54));
  EXPECT_EQ(metrics.result().position_error_px, 8);
  EXPECT_EQ(metrics.result().phase_correlation, 0);
}

TEST(MetricsAccumulator, KeepsTheFloorOfManyWindowsFromASample) {
  ScoredPairs metrics, again;
  for (std::uint64_t i = 0; i < 3 * MetricsAccumulator::kFloorPairs; ++i) {
    metrics.add(noise(2 * i), noise(2 * i + 1));
    again.add(noise(2 * i), noise(2 * i + 1));
  }
  EXPECT_NEAR(metrics.result().phase_correlation_floor, 0.21, 0.04);
  EXPECT_EQ(metrics.result().phase_correlation_floor, again.result().phase_correlation_floor);
}

// Late windows are in the sample as often as early ones: three of four pictures here are the same.
TEST(MetricsAccumulator, SamplesLateWindowsForTheFloorToo) {
  ScoredPairs metrics;
  const Image same = plate("bumps12", 54);
  for (std::uint64_t i = 0; i < 4 * MetricsAccumulator::kFloorPairs; ++i) {
    const Image picture = i < MetricsAccumulator::kFloorPairs ? noise(i) : same;
    metrics.add(picture, picture);
  }
  EXPECT_GT(metrics.result().phase_correlation_floor, 0.4);
}

TEST(MetricsAccumulator, RefusesValuesThatAreNotFinite) {
  ScoredPairs metrics;
  Image output = flat(0);
  output[7] = std::nanf("");
  EXPECT_EQ(what_of<std::invalid_argument>([&] { metrics.add(output, flat(0)); }),
            "metrics: output pixel 7 is not finite");
  EXPECT_EQ(metrics.result().windows, 0U);
}

TEST(ZoneMetrics, CountsGhostsAndMisses) {
  ZoneMetrics metrics{ImageGrid{}};
  Image ghost = flat(0);
  ghost[100] = -0.21F;
  metrics.add(flat(0.19F), flat(0), Zone::flat);
  metrics.add(ghost, flat(0), Zone::flat);
  metrics.add(flat(0), flat(0), Zone::air);
  metrics.add(ghost, flat(0), Zone::near);  // part of `all` alone
  metrics.add(plate("bumps12", 54), plate("bumps12", 54), Zone::contact);
  metrics.add(flat(0.19F), plate("bumps12", 54), Zone::contact);
  EXPECT_EQ(metrics.flat().ghost_rate, 0.5);
  EXPECT_EQ(metrics.air().ghost_rate, 0);
  EXPECT_EQ(metrics.contact().miss_rate, 0.5);
  EXPECT_EQ(metrics.all().ghost_rate, 0.5);
  EXPECT_TRUE(std::isnan(metrics.flat().miss_rate));
  EXPECT_EQ(metrics.to_json()["flat"]["ghost_rate"], 0.5);
  EXPECT_EQ(metrics.to_json()["air"]["windows"], 1);
}

TEST(ZoneMetrics, ReportsContactApart) {
  ZoneMetrics metrics{ImageGrid{}};
  metrics.add(flat(0), flat(0), Zone::flat);  // easy: 60 dB
  metrics.add(flat(0), plate("bumps12", 54), Zone::contact);
  EXPECT_EQ(metrics.all().windows, 2U);
  EXPECT_EQ(metrics.contact().windows, 1U);
  EXPECT_LT(metrics.contact().psnr_mean_db, metrics.all().psnr_mean_db - 20);
  // No position without contact, so these are about the same window.
  EXPECT_EQ(metrics.all().position_error_px, metrics.contact().position_error_px);
  EXPECT_EQ(metrics.to_json()["contact"]["windows"], 1);
}

}  // namespace supertac::metrics_test
