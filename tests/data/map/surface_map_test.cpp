#include "data/map/surface_map.h"

#include "io/numbers/random.h"
#include "tests/support/test.h"

namespace supertac::surface_map_test {

const ImageGrid kGrid{8, 6, Pitch(0.5, 0.75)};

// What a picture around (x, y) shows of a surface.
std::vector<float> seen(const auto& surface, double x_mm, double y_mm, const ImageGrid& g = kGrid) {
  std::vector<float> picture;
  for (int r = 0; r < g.height; ++r)
    for (int c = 0; c < g.width; ++c)
      picture.push_back(static_cast<float>(surface(x_mm + (c + 0.5 - g.width / 2.0) * g.pixel_mm.x,
                                                   y_mm + (r + 0.5 - g.height / 2.0) * g.pixel_mm.y)));
  return picture;
}

double value_at(const SurfaceMap& map, std::int64_t i, std::int64_t j) {
  return map.cells({i, j, 1, 1}).values.at(0);
}

TEST(SurfaceMap, APlaneComesBackAndKeepsItsPlace) {
  const auto plane = [](double x, double y) { return 0.2 + 0.03 * x - 0.02 * y; };
  SurfaceMap map(kGrid);
  EXPECT_TRUE(map.empty());
  for (double y = 5; y < 15; y += 0.13) map.add(-3 + 0.01 * y, y, seen(plane, -3 + 0.01 * y, y), {});
  EXPECT_FALSE(map.empty());
  const MapCells all = map.cells(map.felt());
  EXPECT_TRUE(all.errors.empty());
  int inside = 0;
  for (std::int64_t j = 0; j < all.region.height; ++j) {
    for (std::int64_t i = 2; i + 2 < all.region.width; ++i) {
      if (j < 2 || j + 2 >= all.region.height) continue;
      const double x = (static_cast<double>(all.region.left + i) + 0.5) * 0.5,
                   y = (static_cast<double>(all.region.bottom + j) + 0.5) * 0.75;
      // Pixels beyond a picture's edge are taken as the edge, up to half a pixel in the plane's slope.
      EXPECT_NEAR(all.values.at(static_cast<std::size_t>(j * all.region.width + i)), plane(x, y), 4e-3);
      ++inside;
    }
  }
  EXPECT_GT(inside, 20);
  std::vector<float> picture(kGrid.pixels());
  map.read(-2.9, 9.77, picture);
  const std::vector<float> expected = seen(plane, -2.9, 9.77);
  for (std::size_t p = 0; p < picture.size(); ++p) EXPECT_NEAR(picture[p], expected[p], 0.012) << p;
}

TEST(SurfaceMap, WeighsByWayAndError) {
  // Pictures exactly on the cells, a cell apart along y: interpolation changes nothing.
  const ImageGrid grid{8, 8, 1.0};
  const double errors[] = {0.09, 0.25, 0.16}, drawn[] = {0.1, 0.5, 0.9};
  SurfaceMap map(grid);
  double weight = 0, value = 0, error = 0;
  for (int k = 0; k < 3; ++k) {
    const std::vector<float> picture(64, static_cast<float>(drawn[k])),
        off(64, static_cast<float>(errors[k]));
    map.add(10, 20 + k, picture, off);
    const double w = ((k == 0 ? 0 : 1) + 1e-3) * std::exp(k / 2.0) / errors[k];
    weight += w, value += w * drawn[k], error += w * errors[k];
    EXPECT_NEAR(value_at(map, 10, 20), value / weight, 1e-6) << k;
    EXPECT_NEAR(map.cells({10, 20, 1, 1}).errors.at(0), error / weight, 1e-6) << k;
  }
  EXPECT_TRUE(std::isnan(value_at(map, 14, 20)));
  SurfaceMap frames(grid, false);  // nothing grows
  for (int k = 0; k < 3; ++k)
    frames.add(10, 20 + k, std::vector<float>(64, static_cast<float>(drawn[k])), {});
  EXPECT_NEAR(value_at(frames, 10, 20), (0.001 * 0.1 + 1.001 * 0.5 + 1.001 * 0.9) / 2.003, 1e-6);
}

TEST(SurfaceMap, AFingerThatStandsCountsOnceAndTouchesOfOnePlaceCountAlike) {
  const std::vector<float> low(kGrid.pixels(), 0.2F), high(kGrid.pixels(), 0.8F);
  SurfaceMap stood(kGrid, false), touched(kGrid);
  const auto add = [](SurfaceMap& map, int times, double x_mm, double y_mm,
                      const std::vector<float>& picture) {
    for (int k = 0; k < times; ++k) map.add(x_mm, y_mm, picture, {});
  };
  add(stood, 1, 0, 0, low), add(stood, 1, 0, 0.75, low);
  add(stood, 100, 0, 0.75, high), add(stood, 1, 0, 1.5, high);
  EXPECT_NEAR(value_at(stood, 0, 0), 0.5, 0.06);
  add(touched, 5, 0, 0, low), add(touched, 5, 50, 0, low),
      add(touched, 5, 0, 0, high);  // elsewhere meanwhile
  EXPECT_NEAR(value_at(touched, 0, 0), 0.5, 1e-6);
  EXPECT_TRUE(std::isnan(value_at(touched, 50, 0)));
  EXPECT_NEAR(value_at(touched, 100, 0), 0.2, 1e-6);
}

// A slide whose pictures are wrong while a point is new: the map is nearer to the truth than their mean.
TEST(SurfaceMap, WhatIsDrawnLaterCountsMore) {
  const ImageGrid grid{16, 16, 0.75};
  const auto truth = [](double, double y) { return 0.5 + 0.5 * std::sin(y); };
  SurfaceMap map(grid);
  double off = 0, mean_off = 0;
  int cells = 0;
  for (int k = 0; k < 400; ++k) {
    const double y = 0.1 * k;
    std::vector<float> picture = seen(truth, 0, y, grid);
    for (int r = 0; r < 16; ++r)  // the leading row is off by 0.5, the last is right
      for (int c = 0; c < 16; ++c)
        picture[static_cast<std::size_t>(r * 16 + c)] += 0.5F * static_cast<float>(r) / 15;
    map.add(0, y, picture, {});
  }
  for (std::int64_t j = 10; j < 40; ++j, ++cells) {
    off += value_at(map, 0, j) - truth(0, (static_cast<double>(j) + 0.5) * 0.75);
    mean_off += 0.25;
  }
  EXPECT_LT(off / cells, 0.55 * mean_off / cells);
}

TEST(SurfaceMap, ErrorsBelowAHundredthCountAsOne) {
  SurfaceMap map(kGrid);
  const RandomStream random(7, 1);
  std::vector<float> picture(kGrid.pixels()), errors(kGrid.pixels());
  for (std::uint64_t k = 0; k < 100; ++k) {
    for (std::size_t p = 0; p < errors.size(); ++p)
      errors[p] = static_cast<float>(random.uniform(100 * k + p)) - 0.1F;
    map.add(20 * random.uniform(100'000 + k), 0.1 * static_cast<double>(k), picture, errors);
  }
  for (const float error : map.cells(map.felt()).errors) EXPECT_FALSE(error < 0.0099F);
}

TEST(SurfaceMap, SaysWhatIsWrong) {
  SurfaceMap map(kGrid);
  const std::vector<float> picture(kGrid.pixels()), errors(kGrid.pixels(), 0.1F);
  map.add(std::numeric_limits<double>::quiet_NaN(), 0, picture, errors);
  EXPECT_TRUE(map.empty());
  map.add(0, 0, picture, errors);
  EXPECT_REFUSAL("map: errors expects 48 values, got 0", map.add(0, 0, picture, {}));
  EXPECT_REFUSAL("map: picture expects 48 values, got 4", map.add(0, 0, std::vector<float>(4), {}));
  EXPECT_ERROR(map.add(1e6, 1e6, picture, errors), std::runtime_error, "are positions in mm?");
  EXPECT_ERROR(map.add(1e300, 0, picture, errors), std::runtime_error,
               "map: position expects mm, got 1e+300, 0");
  std::vector<float> read(kGrid.pixels());
  map.read(500, 0, read);
  EXPECT_TRUE(std::isnan(read[0]));
}

}  // namespace supertac::surface_map_test
