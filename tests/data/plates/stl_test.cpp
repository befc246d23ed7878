#include "data/plates/stl.h"

#include <cctype>
#include <ctime>

#include "io/files/file.h"
#include "tests/data/test_recordings.h"
#include "tests/fuzz/corpus.h"
#include "tests/fuzz/stl_properties.h"
#include "tests/support/test.h"

namespace supertac::stl_test {

using Bytes = std::vector<std::byte>;

const std::vector<Triangle>& two_triangles() {
  static const std::vector<Triangle> kTriangles = {{{{0, 0, 0}, {2, 0, 0}, {0, 3, 0}}},
                                                   {{{1.5F, -2.25F, 4}, {0, 1e-3F, 7}, {5, 5, 5}}}};
  return kTriangles;
}

Bytes bytes_of(std::string_view text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

std::string text_stl() {
  return "solid a name of words\n"
         " facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 2 0 +0.0\n   vertex 0 3e0 0\n"
         "  endloop\n endfacet\n"
         "facet NORMAL nan nan nan outer loop vertex 1.5 -2.25 4 vertex 0 1E-3 7 vertex 5 5 5 endloop "
         "endfacet\r\n"
         "endsolid a name of words\n";
}

void expect_refused(const Bytes& bytes, const std::string& expected) {
  SCOPED_TRACE("expected: " + expected);
  EXPECT_ERROR(parse_stl(bytes, "plate.stl"), FileError, expected);
  EXPECT_ERROR(parse_stl(bytes, "plate.stl"), FileError, "plate.stl: ");
}

TEST(Stl, BinaryComesBackExactly) {
  const Bytes bytes = stl_bytes(two_triangles(), "two triangles");
  EXPECT_EQ(bytes.size(), 84u + 2 * 50);
  EXPECT_EQ(parse_stl(bytes, "plate.stl"), two_triangles());
}

TEST(Stl, TextIsReadWhateverItsSpacesAndCase) {
  std::string capitals = text_stl(), old_mac = text_stl();
  for (char& c : capitals) c = static_cast<char>(std::toupper(c));
  std::ranges::replace(old_mac, '\n', '\r');
  for (const std::string& text : {text_stl(), capitals, " \n\t" + text_stl(), "\xEF\xBB\xBF" + text_stl(),
                                  old_mac, text_stl() + "\n\n"})
    EXPECT_EQ(parse_stl(bytes_of(text), "plate.stl"), two_triangles()) << text;
  EXPECT_EQ(parse_stl(bytes_of(text_stl() + text_stl()), "plate.stl").size(), 4u);  // several solids
}

TEST(Stl, NothingIsWrittenThatIsTooLargeToBeRead) {
  EXPECT_REFUSAL("stl_bytes: triangles expects at most 10737416, got 10737418; try a coarser resolution",
                 stl_bytes(std::vector<Triangle>(kMaxStlBytes / 50), "title"));
}

TEST(Stl, LengthTellsBinaryFromTextWhateverTheFirstWord) {
  Bytes bytes = stl_bytes(two_triangles(), "title");
  std::memcpy(bytes.data(), "solid made by a careless exporter", 33);
  EXPECT_EQ(parse_stl(bytes, "plate.stl"), two_triangles());
  bytes.pop_back();  // now neither: cut off, and no text because of its zero bytes
  expect_refused(bytes, "announces 2 triangles, expected 184 bytes, found 183");
}

TEST(Stl, DamagedBinaryNamesTheTriangleOrTheLength) {
  const Bytes good = stl_bytes(two_triangles(), "title");
  for (const float value : {std::numeric_limits<float>::quiet_NaN(), INFINITY, -1e7F}) {
    Bytes bad = good;
    std::memcpy(bad.data() + 84 + 50 + 12 + 8, &value, sizeof value);
    expect_refused(bad, "triangle 2 has the coordinate");
  }
  expect_refused(Bytes{}, "has 0 bytes");
  expect_refused(stl_bytes({}, "empty"), "holds no triangle");
  for (std::size_t length = 0; length < good.size(); ++length)
    expect_refused(Bytes(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(length)),
                   length < 84
                       ? "has " + std::to_string(length) + " bytes, expected an STL file of 84 or more"
                       : "expected 184 bytes, found " + std::to_string(length));
}

TEST(Stl, DamagedTextNamesTheLine) {
  const std::string good = text_stl(), begun = "solid\nfacet normal 0 0 1\nouter ";
  const std::pair<std::string, const char*> cases[] = {
      {"solid\nendsolid", "holds no triangle"},
      {begun + "loop\nvertex 0 nan 0", "line 4: expected a number within +-1000000 mm, found 'nan'"},
      {begun + "lop", "line 3: expected loop, found 'lop'"},
      {"solid\r\nfacet normal 0 0 1\r\nouter lop", "line 3: expected loop"},
      {begun + "loop\nvertex 1 2", "found the end of the file"},
      {"solid\nfacet\n", "expected normal"},
      {"solids of gold", "line 1: expected solid, found 'solids'"},
      {"solid of gold", "expected facet or endsolid, found the end of the file"},
      {good + "sold next\n facet normal 0 0 1\n", "expected solid, found 'sold'"}};
  for (const auto& [text, expected] : cases) expect_refused(bytes_of(text), expected);
  for (std::size_t length = 0; length < good.rfind("endsolid") + 8; ++length)
    expect_refused(bytes_of(good.substr(0, length)), "export it again");
}

TEST(Stl, HostileHeadersCostNothing) {
  Bytes bytes(84);
  const std::clock_t begin = std::clock();
  for (const std::uint32_t count : {1u, 1000u, 0x7FFF'FFFFu, 0xFFFF'FFFFu}) {
    std::memcpy(bytes.data() + 80, &count, sizeof count);
    expect_refused(bytes, "announces " + std::to_string(count) + " triangles, expected " +
                              std::to_string(84 + 50 * std::uint64_t{count}) + " bytes, found 84");
  }
  // The count must not size anything: clearing what it asks for would take many seconds.
  EXPECT_LT(std::clock() - begin, CLOCKS_PER_SEC);
}

TEST(Stl, FilesAreReadWithALimit) {
  const TemporaryFolder folder;
  write_file(folder / "plate.stl", stl_bytes(two_triangles(), "title"));
  EXPECT_EQ(read_stl(folder / "plate.stl"), two_triangles());
  EXPECT_EQ(what_of<FileError>([&] { read_stl(folder / "missing.stl"); }),
            folder / "missing.stl" + ": cannot open the file: No such file or directory; check the name");
  write_file(folder / "huge.stl", std::string());
  std::filesystem::resize_file(folder / "huge.stl", kMaxStlBytes + 1);  // sparse
  EXPECT_EQ(what_of<FileError>([&] { read_stl(folder / "huge.stl"); }),
            folder / "huge.stl" + ": has 536870913 bytes, expected at most 536870912; is it the right file?");
}

TEST(Stl, FuzzCorpus) { EXPECT_GE(replay("stl", check_stl), 256); }

void add_quad(std::vector<Triangle>& triangles, const Vertex& a, const Vertex& b, const Vertex& c,
              const Vertex& d) {
  triangles.push_back({a, b, c});
  triangles.push_back({a, c, d});
}

// A sheet of 36 x 108 mm at height z with its corner at (x, y).
std::vector<Triangle> sheet(float z = 0, float x = 0, float y = 0) {
  std::vector<Triangle> triangles;
  add_quad(triangles, {x, y, z}, {x + 36, y, z}, {x + 36, y + 108, z}, {x, y + 108, z});
  return triangles;
}

HeightMap height_map_of(const std::vector<Triangle>& triangles) { return {triangles, "plate.stl"}; }

void expect_map_refused(const std::vector<Triangle>& triangles, const std::string& expected) {
  EXPECT_ERROR(height_map_of(triangles), FileError, expected);
}

TEST(HeightMap, HeightIsThatOfTheHighestTriangleAboveTheOutline) {
  auto triangles = sheet(7, -20, 300);                                            // anywhere, at any height
  add_quad(triangles, {-10, 340, 8}, {-5, 340, 8}, {-5, 350, 8}, {-10, 350, 8});  // a step of 1 mm
  add_quad(triangles, {-10, 340, 4}, {-10, 350, 4}, {-5, 350, 4}, {-5, 340, 4});  // below: hidden
  triangles.push_back({Vertex{0, 340, 7}, Vertex{10, 340, 7}, Vertex{0, 340, 9.5F}});  // a wall
  const HeightMap map = height_map_of(triangles);
  EXPECT_EQ(map(12, 45), 1);
  EXPECT_EQ(map(9.5, 45), 0);
  EXPECT_EQ(map(12, 39.5), 0);
  EXPECT_NEAR(map(20, 40), 2.5, 1e-5);
  EXPECT_NEAR(map(25, 40), 1.25, 1e-5);
  EXPECT_EQ(map(25, 40.5), 0);
  EXPECT_EQ(map.extent().max_height, 2.5);
  EXPECT_EQ(map.extent().min_height, 0);
  EXPECT_EQ(map.extent().texture_begin, 39.875);
  EXPECT_EQ(map.extent().texture_end, 50.125);
  EXPECT_FALSE(map.extent().uniform_in_x);
}

TEST(HeightMap, ATipThatOnlyTouchesANodeCounts) {
  auto triangles = sheet();
  triangles.push_back({Vertex{10, 20, 1}, Vertex{12, 20, 1}, Vertex{11, 22, 2}});
  EXPECT_EQ(height_map_of(triangles)(11, 22), 2);
}

TEST(HeightMap, SlantedFacesAreExactAtNodesAndLinearBetween) {
  std::vector<Triangle> triangles;
  const auto z = [](float x, float y) { return 0.05F * x - 0.02F * y; };
  const auto at = [&](float x, float y) { return Vertex{x, y, z(x, y)}; };
  triangles.push_back({at(0, 0), at(36, 0), at(0, 108)});
  triangles.push_back({at(36, 0), at(36, 108), at(0, 108)});
  const HeightMap map = height_map_of(triangles);
  const double level = map(0, 0);  // of (0, 0) above the outline's median
  for (double x = 0; x <= 36; x += 1.7)
    for (double y = 0; y <= 108; y += 3.3)
      EXPECT_NEAR(map(x, y) - level, 0.05 * x - 0.02 * y, 1e-3) << x << " " << y;
}

TEST(HeightMap, OutsideIsFlat) {
  auto triangles = sheet();
  add_quad(triangles, {0, 40, 1}, {36, 40, 1}, {36, 50, 1}, {0, 50, 1});
  const HeightMap map = height_map_of(triangles);
  EXPECT_EQ(map(0, 45), 1);
  EXPECT_EQ(map(36, 45), 1);
  for (const double x : {-0.01, 36.01, 1e300, std::nan("")}) EXPECT_EQ(map(x, 45), 0);
  EXPECT_EQ(map(18, -1), 0);
  EXPECT_EQ(map(18, 109), 0);
  EXPECT_TRUE(map.extent().uniform_in_x);
  ASSERT_EQ(map.extent().crests.size(), 1u);
  EXPECT_NEAR(map.extent().crests[0], 45, 1e-9);
}

TEST(HeightMap, AFlatPlateHasNoTexture) {
  const PlateExtent flat = height_map_of(sheet(3)).extent();
  EXPECT_EQ(flat.max_height, 0);
  EXPECT_EQ(std::pair(flat.texture_begin, flat.texture_end), std::pair(54.0, 54.0));
  EXPECT_TRUE(flat.crests.empty());
}

TEST(HeightMap, RefusesOtherSizesHolesAndOverlaps) {
  auto inches = sheet();
  for (Triangle& triangle : inches)
    for (Vertex& corner : triangle)
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
  std::vector<Triangle> point = {{Vertex{1, 1, 1}, Vertex{1, 1, 1}, Vertex{1, 1, 1}}};
  expect_map_refused(point, "measures 0.00 x 0.00 mm");
}

const std::vector<std::string>& plates() {
  static const std::vector<std::string> kNames = {
      "3_Bumps", "6_Ridges", "4_Waves", "4_Blob", "plain", "ridges4.7h1.3", "bumps6+ridges6+waves6+blobs6"};
  return kNames;
}

Plate read(const std::vector<Triangle>& solid, const std::string& name) {
  const HeightMap map(solid, name);
  return {name, map, map.extent()};
}

// Every directed edge once, and its opposite once: closed, manifold, facing one way.
TEST(PlateMesh, EveryEdgeBelongsToTwoTriangles) {
  for (const std::string& name : plates()) {
    std::map<std::pair<Vertex, Vertex>, int> edges;
    for (const Triangle& t : mesh_of(Plate::named(name)))
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

// What supertac-plate's help states.
TEST(PlateMesh, RigPlatesComeBackExactlyAtTheNodes) {
  for (const std::string& name : kRigPlates) {
    const Plate plate = Plate::named(name);
    const Plate again = read(parse_stl(stl_bytes(mesh_of(plate), name), name), name);
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
  constexpr float kBlocks[][4] = {{40, 50, 2, 2}, {40.05F, 50, 2, 2.04F}, {60, 108, 1, 1}};
  for (const auto& [from, to, low, high] : kBlocks) {
    std::vector<Triangle> triangles = sheet();
    add_quad(triangles, {0, from, low}, {36, from, high}, {36, to, high}, {0, to, low});
    const Plate first = read(triangles, "p"), second = read(mesh_of(first), "p");
    for (double y = 0; y <= 108; y += 0.11)
      for (double x = 0; x <= 36; x += 0.6)
        ASSERT_NEAR(second.height(x, y), first.height(x, y), 0.01) << x << " " << y;
    EXPECT_EQ(second.height(18, 20), 0);
    EXPECT_EQ(mesh_of(second), mesh_of(first));
  }
}

TEST(PlateMesh, UniformPlatesAreSmall) { EXPECT_LT(mesh_of(Plate::named("6_Bumps")).size(), 3000u); }

}  // namespace supertac::stl_test
