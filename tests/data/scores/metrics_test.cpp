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

Image plate(const char* name, double y, int size = 16, double x = 18) {
  Image image = flat(0, size);
  truth_image(Plate::named(name), x, y, {size, size, 12.0 / size}, image);
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

double ssim(const Image& a, const Image& b) {
  const auto side = static_cast<std::size_t>(std::lround(std::sqrt(static_cast<double>(a.size()))));
  return supertac::ssim(a, b, side, side);
}

TEST(Ssim, OfIdenticalFlatAndInvertedImages) {
  for (const int size : {8, 16, 32}) {
    EXPECT_NEAR(ssim(noise(1, size), noise(1, size)), 1, 1e-12);
    EXPECT_NEAR(ssim(plate("ridges6", 51, size), plate("ridges6", 51, size)), 1, 1e-12);
    EXPECT_LT(ssim(noise(2, size), mapped(noise(2, size), -1, 1)), -0.8);
  }
  for (const float level : {0.0F, 200.0F}) EXPECT_NEAR(ssim(flat(level), flat(level)), 1, 1e-12);
  EXPECT_NEAR(ssim(flat(0.5F), flat(0.25F)), (2 * 0.125 + 1e-4) / (0.25 + 0.0625 + 1e-4), 1e-9);
  EXPECT_LT(ssim(flat(0.5F), noise(2)), 0.05);
  EXPECT_GT(ssim(flat(0.5F), noise(2)), 0);
}

// E[x^2] - E[x]^2 in single precision comes out negative at level 200, where the luminance term is 1, so that
// contrast and structure are left.
TEST(Ssim, VariancesAreCentred) {
  EXPECT_NEAR(ssim(mapped(noise(1), 1, 200), mapped(noise(2), 1, 200)),
              ssim(mapped(noise(1), 1, 20), mapped(noise(2), 1, 20)), 2e-3);
}

// Numbers of an independent NumPy implementation (explicit windows, double precision, range 1).
TEST(Ssim, AgreesWithHandComputedWindow) {
  for (const auto& [size, expected] : {std::pair(8, 0.047516553), {16, -0.084639437}}) {
    Image a = flat(0, size), b = flat(0, size);
    for (std::size_t i = 0; i < a.size(); ++i)
      a[i] = static_cast<float>(i % 5) / 4, b[i] = static_cast<float>(i * i % 7) / 6;
    EXPECT_NEAR(ssim(a, b), expected, 1e-6);
  }
}

TEST(Ssim, RefusesImagesWithoutAValidPosition) {
  EXPECT_REFUSAL("ssim: size expects 3 pixels or more, got 2", ssim(flat(0, 2), flat(0, 2)));
  EXPECT_REFUSAL("ssim: image expects 256 values, got 64", ssim(flat(0, 16), flat(0, 8)));
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

TEST(MetricsAccumulator, MeasuresPixelsOfAnySize) {
  const ImageGrid grid{8, 24, 0.5};
  ScoredPairs metrics(grid);
  std::vector<float> truth(grid.pixels()), moved(grid.pixels());
  truth_image(Plate::named("4_Blob"), 18, 52, grid, truth);
  truth_image(Plate::named("4_Blob"), 17, 52, grid, moved);
  metrics.add(moved, truth);
  EXPECT_NEAR(metrics.result().position_error_px, 2, 0.4);
  EXPECT_DOUBLE_EQ(metrics.result().position_error_mm, metrics.result().position_error_px * 0.5);
  // A collapsed network must not look as if it knew where things are.
  ScoredPairs of_flat(grid);
  of_flat.add(std::vector<float>(grid.pixels(), 0.5F), truth);
  EXPECT_EQ(of_flat.result().position_error_px, 4);  // half the shorter side
  EXPECT_EQ(of_flat.result().phase_correlation, 0);
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
  EXPECT_REFUSAL("metrics: output pixel 7 expects a finite number, got nan", metrics.add(output, flat(0)));
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
  EXPECT_EQ(metrics.contact().miss_rate, 0.5);
  EXPECT_EQ(metrics.all().ghost_rate, 0.5);
  const auto json = metrics.to_json();
  EXPECT_EQ(json["flat"]["ghost_rate"], 0.5);
  EXPECT_TRUE(json["flat"]["miss_rate"].is_null());
  EXPECT_EQ(json["air"]["ghost_rate"], 0);
  EXPECT_EQ(json["air"]["windows"], 1);
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

Image with_noise(Image image, double level, std::uint64_t stream) {
  const RandomStream random(7, stream);
  for (std::size_t i = 0; i < image.size(); ++i) image[i] += static_cast<float>(level * random.normal(i));
  return image;
}

// FIELD: two identical ridges have 0.0625 without a Hann window, 0.937 with it, 0.31 with noise of 0.05 in
// both; images of noise alone have 0.21.
TEST(PhaseCorrelation, IdenticalRidgesAgreeBecauseOfTheHannWindow) {
  PhaseCorrelator correlator(16, 16);
  for (const auto& [name, level, expected] : {std::tuple("ridges6", 0.0, 0.937),
                                              {"bumps12", 0.0, 0.937},
                                              {"ridges6", 0.05, 0.31},
                                              {"plain", 0.2, 0.21}}) {
    double sum = 0;
    for (std::uint64_t i = 0; i < 50; ++i) {
      const auto image = plate(name, 48 + 0.18 * static_cast<double>(i));
      sum += correlator(with_noise(image, level, 2 * i), with_noise(image, level, 2 * i + 1)).peak;
    }
    EXPECT_NEAR(sum / 50, expected, level > 0 ? 0.05 : 0.02) << name << " " << level;
  }
}

TEST(PhaseCorrelation, IgnoresAmplitudeAndLevel) {
  PhaseCorrelator correlator(16, 16);
  const auto image = plate("blobs9", 50, 16, 17);
  auto weak = image;
  for (float& v : weak) v = 0.3F + 0.01F * v;
  const auto strong_against_weak = correlator(weak, image);
  EXPECT_NEAR(strong_against_weak.peak, correlator(image, image).peak, 0.06);
  EXPECT_NEAR(strong_against_weak.dx_px, 0, 1e-3);
  EXPECT_NEAR(strong_against_weak.dy_px, 0, 1e-3);
}

// The sign: the finger moved by +d on the plate, so what it sees lies d further down the rows.
TEST(PhaseCorrelation, FindsTheDisplacementBelowAPixel) {
  for (const char* name : {"ridges6", "bumps12", "bumps6"}) {
    for (const int size : {16, 32}) {
      PhaseCorrelator correlator(size, size);
      for (const double shift_mm : {-1.5, -0.5, 0.25, 0.9, 1.5}) {
        const double centre = name[5] == '1' ? 54 : 57;  // an element near the middle of the window
        const auto truth = plate(name, centre, size);
        const auto moved = plate(name, centre - shift_mm, size);
        const auto found = correlator(moved, truth);
        EXPECT_NEAR(found.dy_px * 12 / size, shift_mm, 0.2) << name << " " << size;
        EXPECT_NEAR(found.dx_px, 0, 0.01) << name;
      }
    }
  }
}

TEST(PhaseCorrelation, FlatImagesHaveNoPhase) {
  PhaseCorrelator correlator(16, 16);
  const Image grey = flat(0.3F);
  const auto bumps = plate("bumps12", 54);
  for (const auto& result : {correlator(grey, grey), correlator(grey, bumps), correlator(bumps, grey)}) {
    EXPECT_FALSE(result.defined);
    EXPECT_EQ(result.peak, 0);
    EXPECT_EQ(result.dy_px, 0);
  }
}

TEST(PhaseCorrelation, RefusesOtherSizes) {
  EXPECT_REFUSAL("phase correlation: sides expects 4 pixels or more, got 8x2", PhaseCorrelator(8, 2));
  PhaseCorrelator correlator(8, 8);
  const std::vector<float> small(64), large(65);
  EXPECT_REFUSAL("phase correlation: image expects 64 values, got 65", correlator(small, large));
}

// Every size that an array of up to 64x64 taxels and a scale of 2, 4 or 8 can give, but for the largest,
// which take long: each finds the shift of a blob, along x and along y.
TEST(PhaseCorrelation, TakesEverySizeOfPicture) {
  for (int height = 4; height <= 512; height += height < 72 ? 2 : 88)
    for (const int width : {4, 6, 14, 18, 34, 54, 56, 64, 96, 128, 200, 512}) {
      PhaseCorrelator correlator(height, width);
      const auto blob = [&](double x, double y) {
        std::vector<float> image(static_cast<std::size_t>(height) * static_cast<std::size_t>(width));
        for (std::size_t i = 0; i < image.size(); ++i) {
          const double dx = static_cast<double>(i % static_cast<std::size_t>(width)) - x;
          const double dy = static_cast<double>(i / static_cast<std::size_t>(width)) - y;
          image[i] = static_cast<float>(1 / (1 + dx * dx + dy * dy));
        }
        return image;
      };
      const double x = width / 2.0, y = height / 2.0;
      const PhaseCorrelation same = correlator(blob(x, y), blob(x, y));
      ASSERT_TRUE(same.defined) << height << "x" << width;
      ASSERT_NEAR(same.dx_px, 0, 1e-3) << height << "x" << width;
      if (height < 12 || width < 12) continue;
      const PhaseCorrelation moved = correlator(blob(x + 1, y), blob(x, y + 1));
      ASSERT_NEAR(moved.dx_px, 1, 0.6) << height << "x" << width;
      ASSERT_NEAR(moved.dy_px, -1, 0.6) << height << "x" << width;
    }
}

}  // namespace supertac::metrics_test
