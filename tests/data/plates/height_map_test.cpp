#include "data/plates/stl.h"

#include "io/files/file.h"
#include "tests/support/test.h"

namespace supertac::height_map_test {

using PlatePoint = std::array<float, 3>;

void add_quad(std::vector<Triangle>& triangles, const PlatePoint& a, const PlatePoint& b, const PlatePoint& c,
              const PlatePoint& d) {
  triangles.push_back({a, b, c});
  triangles.push_back({a, c, d});
}

// A sheet of 36 x 108 mm at height z with its corner at (x, y).
std::vector<Triangle> sheet(float z = 0, float x = 0, float y = 0) {
  std::vector<Triangle> triangles;
  add_quad(triangles, {x, y, z}, {x + 36, y, z}, {x + 36, y + 108, z}, {x, y + 108, z});
  return triangles;
}

HeightMap height_map_of(const std::vector<Triangle>& triangles) { return {triangles, 36, 108, "plate.stl"}; }

void expect_map_refused(const std::vector<Triangle>& triangles, const std::string& expected) {
  EXPECT_ERROR(height_map_of(triangles), FileError, expected);
}

TEST(HeightMap, HeightIsThatOfTheHighestTriangleAboveTheOutline) {
  auto triangles = sheet(7, -20, 300);                                            // anywhere, at any height
  add_quad(triangles, {-10, 340, 8}, {-5, 340, 8}, {-5, 350, 8}, {-10, 350, 8});  // a step of 1 mm
  add_quad(triangles, {-10, 340, 4}, {-10, 350, 4}, {-5, 350, 4}, {-5, 340, 4});  // below: hidden
  triangles.push_back({PlatePoint{0, 340, 7}, PlatePoint{10, 340, 7}, PlatePoint{0, 340, 9.5F}});  // a wall
  const HeightMap map = height_map_of(triangles);
  EXPECT_EQ(map.height(12, 45), 1);
  EXPECT_EQ(map.height(9.5, 45), 0);
  EXPECT_EQ(map.height(12, 39.5), 0);
  EXPECT_NEAR(map.height(20, 40), 2.5, 1e-5);
  EXPECT_NEAR(map.height(25, 40), 1.25, 1e-5);
  EXPECT_EQ(map.height(25, 40.5), 0);
  EXPECT_EQ(map.extent().max_height, 2.5);
  EXPECT_EQ(map.extent().min_height, 0);
  EXPECT_EQ(map.extent().texture_begin, 39.875);
  EXPECT_EQ(map.extent().texture_end, 50.125);
  EXPECT_FALSE(map.extent().uniform_in_x);
}

TEST(HeightMap, ATipThatOnlyTouchesANodeCounts) {
  auto triangles = sheet();
  triangles.push_back({PlatePoint{10, 20, 1}, PlatePoint{12, 20, 1}, PlatePoint{11, 22, 2}});
  EXPECT_EQ(height_map_of(triangles).height(11, 22), 2);
}

TEST(HeightMap, SlantedFacesAreExactAtNodesAndLinearBetween) {
  std::vector<Triangle> triangles;
  const auto z = [](float x, float y) { return 0.05F * x - 0.02F * y; };
  const auto at = [&](float x, float y) { return PlatePoint{x, y, z(x, y)}; };
  triangles.push_back({at(0, 0), at(36, 0), at(0, 108)});
  triangles.push_back({at(36, 0), at(36, 108), at(0, 108)});
  const HeightMap map = height_map_of(triangles);
  const double level = map.height(0, 0);  // of (0, 0) above the outline's median
  for (double x = 0; x <= 36; x += 1.7)
    for (double y = 0; y <= 108; y += 3.3)
      EXPECT_NEAR(map.height(x, y) - level, 0.05 * x - 0.02 * y, 1e-3) << x << " " << y;
}

TEST(HeightMap, OutsideIsFlat) {
  auto triangles = sheet();
  add_quad(triangles, {0, 40, 1}, {36, 40, 1}, {36, 50, 1}, {0, 50, 1});
  const HeightMap map = height_map_of(triangles);
  EXPECT_EQ(map.height(0, 45), 1);
  EXPECT_EQ(map.height(36, 45), 1);
  for (const double x : {-0.01, 36.01, 1e300, std::nan("")}) EXPECT_EQ(map.height(x, 45), 0);
  EXPECT_EQ(map.height(18, -1), 0);
  EXPECT_EQ(map.height(18, 109), 0);
  EXPECT_TRUE(map.extent().uniform_in_x);
  ASSERT_EQ(map.extent().crests.size(), 1u);
  EXPECT_NEAR(map.extent().crests[0], 45, 1e-9);
}

TEST(HeightMap, AFlatPlateHasNoTexture) {
  const HeightMap map = height_map_of(sheet(3));
  EXPECT_EQ(map.extent().max_height, 0);
  EXPECT_EQ(map.extent().texture_begin, 54);
  EXPECT_EQ(map.extent().texture_end, 54);
  EXPECT_TRUE(map.extent().crests.empty());
}

TEST(HeightMap, RefusesOtherSizesHolesAndOverlaps) {
  auto inches = sheet();
  for (Triangle& triangle : inches)
    for (PlatePoint& corner : triangle)
      for (float& value : corner) value /= 25.4F;
  expect_map_refused(inches, "measures 1.42 x 4.25 mm in x and y, expected 36 x 108");
  std::vector<Triangle> turned;
  add_quad(turned, {0, 0, 0}, {108, 0, 0}, {108, 36, 0}, {0, 36, 0});
  expect_map_refused(turned, "measures 108.00 x 36.00 mm");
  const std::vector<Triangle> half = {sheet()[0]};
  expect_map_refused(half, "has holes");
  std::vector<Triangle> heap;
  for (int i = 0; i < 300; ++i) heap.push_back(sheet()[0]);
  expect_map_refused(heap, "cover the plate more than");
  std::vector<Triangle> point = {{PlatePoint{1, 1, 1}, PlatePoint{1, 1, 1}, PlatePoint{1, 1, 1}}};
  expect_map_refused(point, "measures 0.00 x 0.00 mm");
}

}  // namespace supertac::height_map_test
