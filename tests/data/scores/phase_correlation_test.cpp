#include "data/scores/phase_correlation.h"

#include "data/plates/truth.h"
#include "io/numbers/random.h"
#include "tests/support/test.h"

namespace supertac::phase_correlation_test {

std::vector<float> image_of(const char* plate, double x, double y, int size = 16) {
  std::vector<float> image(static_cast<std::size_t>(size * size));
  truth_image(Plate::named(plate), x, y, {size, size, 12.0 / size}, image);
  return image;
}

std::vector<float> with_noise(std::vector<float> image, double level, std::uint64_t stream) {
  const RandomStream random(7, stream);
  for (std::size_t i = 0; i < image.size(); ++i) image[i] += static_cast<float>(level * random.normal(i));
  return image;
}

double mean_peak_of_itself(const char* plate, double noise) {
  PhaseCorrelator correlator(16, 16);
  double sum = 0;
  for (int i = 0; i < 20; ++i) {
    const auto image = image_of(plate, 18, 48 + 0.45 * i);
    const auto n = static_cast<std::uint64_t>(i);
    sum += correlator(with_noise(image, noise, 2 * n), with_noise(image, noise, 2 * n + 1)).peak;
  }
  return sum / 20;
}

// FIELD: .0625 without a window, .937 with it, .31 with noise of .05 in both.
TEST(PhaseCorrelation, IdenticalRidgesAgreeBecauseOfTheHannWindow) {
  EXPECT_NEAR(mean_peak_of_itself("ridges6", 0), 0.937, 0.02);
  EXPECT_NEAR(mean_peak_of_itself("bumps12", 0), 0.937, 0.02);
}

TEST(PhaseCorrelation, NoiseCostsMostOfThePeak) {
  EXPECT_NEAR(mean_peak_of_itself("ridges6", 0.05), 0.31, 0.05);
}

TEST(PhaseCorrelation, UnrelatedImagesScoreTheFloor) {
  PhaseCorrelator correlator(16, 16);
  double sum = 0;
  const std::vector<float> flat(256, 0.5F);
  for (std::uint64_t i = 0; i < 50; ++i)
    sum += correlator(with_noise(flat, 0.2, 2 * i), with_noise(flat, 0.2, 2 * i + 1)).peak;
  EXPECT_NEAR(sum / 50, 0.21, 0.04);
}

TEST(PhaseCorrelation, IgnoresAmplitudeAndLevel) {
  PhaseCorrelator correlator(16, 16);
  const auto image = image_of("blobs9", 17, 50);
  auto weak = image;
  for (float& v : weak) v = 0.3F + 0.01F * v;
  const auto strong_against_weak = correlator(weak, image);
  EXPECT_NEAR(strong_against_weak.peak, correlator(image, image).peak, 0.06);
  EXPECT_NEAR(strong_against_weak.dx_px, 0, 1e-3);
  EXPECT_NEAR(strong_against_weak.dy_px, 0, 1e-3);
}

// The sign: the finger moved by +d on the plate, so what it sees lies d further down the rows.
TEST(PhaseCorrelation, FindsTheDisplacementBelowAPixel) {
  for (const char* plate : {"ridges6", "bumps12", "bumps6"}) {
    for (const int size : {16, 32}) {
      PhaseCorrelator correlator(size, size);
      for (const double shift_mm : {-1.5, -0.5, 0.25, 0.9, 1.5}) {
        const double centre = plate[5] == '1' ? 54 : 57;  // an element near the middle of the window
        const auto truth = image_of(plate, 18, centre, size);
        const auto moved = image_of(plate, 18, centre - shift_mm, size);
        const auto found = correlator(moved, truth);
        EXPECT_NEAR(found.dy_px * 12 / size, shift_mm, 0.2) << plate << " " << size;
        EXPECT_NEAR(found.dx_px, 0, 0.01) << plate;
      }
    }
  }
}

TEST(PhaseCorrelation, TellsXFromY) {
  PhaseCorrelator correlator(16, 16);
  const auto truth = image_of("4_Blob", 18, 52), moved = image_of("4_Blob", 17.25, 53.5);
  const auto found = correlator(moved, truth);
  EXPECT_NEAR(found.dx_px, 1, 0.25);
  EXPECT_NEAR(found.dy_px, -2, 0.25);
}

TEST(PhaseCorrelation, SidesMayDiffer) {
  PhaseCorrelator correlator(8, 24);
  const ImageGrid grid{8, 24, 0.5};
  std::vector<float> truth(grid.pixels()), moved(grid.pixels());
  truth_image(Plate::named("4_Blob"), 18, 52, grid, truth);
  truth_image(Plate::named("4_Blob"), 17, 52.5, grid, moved);
  const auto found = correlator(moved, truth);
  EXPECT_NEAR(found.dx_px, 2, 0.35);
  EXPECT_NEAR(found.dy_px, -1, 0.35);
}

TEST(PhaseCorrelation, FlatImagesHaveNoPhase) {
  PhaseCorrelator correlator(16, 16);
  const std::vector<float> flat(256, 0.3F);
  const auto bumps = image_of("bumps12", 18, 54);
  for (const auto& result : {correlator(flat, flat), correlator(flat, bumps), correlator(bumps, flat)}) {
    EXPECT_FALSE(result.defined);
    EXPECT_EQ(result.peak, 0);
    EXPECT_EQ(result.dy_px, 0);
  }
}

TEST(PhaseCorrelation, RefusesOtherSizes) {
  EXPECT_EQ(what_of<std::invalid_argument>([&] { PhaseCorrelator(8, 2); }),
            "phase correlation: sides must be at least 4, got 8x2");
  PhaseCorrelator correlator(8, 8);
  const std::vector<float> small(64), large(65);
  EXPECT_EQ(what_of<std::invalid_argument>([&] { correlator(small, large); }),
            "phase correlation: expects 64 pixels, got 65");
}

// Every size that an array of up to 64x64 taxels and a scale of 2, 4 or 8 can give, but for the largest,
// which take long: each finds the shift of a blob.
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

}  // namespace supertac::phase_correlation_test
