#include "data/plates/plate_mesh.h"

#include "data/plates/stl.h"
#include "io/numbers/random.h"
#include "tests/data/rig_plates.h"
#include "tests/support/test.h"

namespace supertac::plate_mesh_test {

using Point = std::array<float, 3>;

const std::vector<std::string>& plates() {
  static const std::vector<std::string> kNames = {
      "3_Bumps", "6_Ridges", "4_Waves", "4_Blob", "plain", "ridges4.7h1.3", "bumps6+ridges6+waves6+blobs6"};
  return kNames;
}

Plate read(const std::vector<Triangle>& solid, const std::string& name) {
  return {name, std::make_shared<const HeightMap>(solid, rig::kPlateWidthMm, rig::kPlateLengthMm, name)};
}

// Every directed edge once, and its opposite once: closed, manifold, facing one way.
TEST(PlateMesh, EveryEdgeBelongsToTwoTriangles) {
  for (const std::string& name : plates()) {
    std::map<std::pair<Point, Point>, int> edges;
    for (const Triangle& t : mesh_of(Plate::named(name), {.resolution_mm = 0.5}))
      for (std::size_t i = 0; i < 3; ++i) ++edges[{t[i], t[(i + 1) % 3]}];
    for (const auto& [edge, count] : edges) {
      ASSERT_EQ(count, 1) << name;
      ASSERT_TRUE(edges.contains({edge.second, edge.first})) << name;
    }
  }
}

// Divergence theorem: positive when the triangles face outwards.
double volume_of(const std::vector<Triangle>& triangles) {
  double six = 0;
  for (const Triangle& t : triangles) {
    const auto [ax, ay, az] = t[0];
    const auto [bx, by, bz] = t[1];
    const auto [cx, cy, cz] = t[2];
    six += double{ax} * (double{by} * double{cz} - double{bz} * double{cy}) -
           double{ay} * (double{bx} * double{cz} - double{bz} * double{cx}) +
           double{az} * (double{bx} * double{cy} - double{by} * double{cx});
  }
  return six / 6;
}

TEST(PlateMesh, VolumeIsThatOfThePlate) {
  const double block = 36.0 * 108 * 3;
  EXPECT_NEAR(volume_of(mesh_of(Plate::named("plain"))), block, 0.1);
  EXPECT_NEAR(volume_of(mesh_of(Plate::named("6_Ridges"))), block + 6 * 0.5 * 2.5 * 2.5 * 36, 0.1);
  const double bump = std::numbers::pi / 2 * 2.5 * 2.5 * 36;
  EXPECT_NEAR(volume_of(mesh_of(Plate::named("3_Bumps"))), block + 3 * bump, 0.005 * 3 * bump);
  const double blob = 2.0 / 3 * std::numbers::pi * 2.5 * 2.5 * 2.5;
  EXPECT_NEAR(volume_of(mesh_of(Plate::named("4_Blob"))), block + 16 * blob, 0.01 * 16 * blob);
}

// Written, read and looked at anywhere: what supertac-plate's help states.
TEST(PlateMesh, WrittenAndReadHeightsAgree) {
  const RandomStream random(11, 0);
  for (const std::string& name : plates()) {
    const Plate plate = Plate::named(name);
    const Plate again = read(parse_stl(stl_bytes(mesh_of(plate), name), name), name);
    EXPECT_NEAR(again.max_height(), plate.max_height(), 0.13) << name;  // a ridge's peak between two nodes
    double squares = 0;
    const int points = 20'000;
    for (std::uint64_t i = 0; i < points; ++i) {
      const double x = 36 * random.uniform(2 * i), y = 108 * random.uniform(2 * i + 1);
      const double error = again.height(x, y) - plate.height(x, y);
      ASSERT_LT(std::abs(error), 0.8)
          << name << " at " << x << " " << y;  // beside the upright foot of a bump
      squares += error * error;
    }
    EXPECT_LT(std::sqrt(squares / points), 0.02) << name;
  }
}

TEST(PlateMesh, RigPlatesComeBackExactlyAtTheNodes) {
  for (const std::string name : kRigPlates) {
    const Plate plate = Plate::named(name);
    const Plate again = read(mesh_of(plate), name);
    EXPECT_NEAR(again.texture_begin(), plate.texture_begin(), 0.126) << name;
    EXPECT_NEAR(again.texture_end(), plate.texture_end(), 0.126) << name;
    EXPECT_EQ(again.uniform_in_x(), plate.uniform_in_x()) << name;
    for (double y = 0; y <= 108; y += HeightMap::kCellMm)
      for (double x = 0; x <= 36; x += 1.5)
        ASSERT_NEAR(again.height(x, y), plate.height(x, y), 1.001e-3) << name << " at " << x << " " << y;
    ASSERT_EQ(again.crests().size(), plate.crests().size()) << name;
    for (std::size_t i = 0; i < plate.crests().size(); ++i)
      EXPECT_NEAR(again.crests()[i], plate.crests()[i], 0.01) << name;
  }
}

// A block with upright sides, one with a slope across that is less than what counts as uniform, a hill that
// ends at the plate's edge: read, written and read again, twice.
TEST(PlateMesh, APlateThatWasReadIsWrittenAsItIs) {
  const auto box = [](float from, float to, float low, float high) {
    const Point a{0, from, low}, b{36, from, high}, c{36, to, high}, d{0, to, low};
    return std::vector<Triangle>{{a, b, c}, {a, c, d}};
  };
  const std::vector<Triangle> ground = box(0, 108, 0, 0);
  for (const auto& top : {box(40, 50, 2, 2), box(40.05F, 50, 2, 2.04F), box(60, 108, 1, 1)}) {
    std::vector<Triangle> triangles = ground;
    triangles.insert(triangles.end(), top.begin(), top.end());
    const Plate first = read(triangles, "p"), second = read(mesh_of(first), "p");
    for (double y = 0; y <= 108; y += 0.11)
      for (double x = 0; x <= 36; x += 0.6)
        ASSERT_NEAR(second.height(x, y), first.height(x, y), 0.01) << x << " " << y;
    EXPECT_EQ(second.height(18, 20), 0);
    EXPECT_EQ(mesh_of(second), mesh_of(first));
  }
}

TEST(PlateMesh, UniformPlatesAreSmallAndSettingsAreChecked) {
  EXPECT_LT(mesh_of(Plate::named("6_Bumps")).size(), 3000u);
  EXPECT_EQ(what_of<std::invalid_argument>([&] { mesh_of(Plate::named("plain"), {.resolution_mm = 0}); }),
            "mesh_of: expected a resolution of 0.02 to 5 mm and a base of 0.2 to 100 mm, got 0 and 3");
  EXPECT_EQ(what_of<std::invalid_argument>([&] { mesh_of(Plate::named("plain"), {.base_mm = -1}); }),
            "mesh_of: expected a resolution of 0.02 to 5 mm and a base of 0.2 to 100 mm, got 0.125 and -1");
}

}  // namespace supertac::plate_mesh_test
