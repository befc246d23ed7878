#include "data/map/named_map.h"

#include "data/plates/stl.h"
#include "data/plates/truth.h"
#include "io/files/safetensors.h"
#include "io/numbers/median.h"
#include "io/numbers/random.h"
#include "tests/support/test.h"

namespace supertac::named_map_test {

constexpr double kCellMm = 0.75;

// A map of a plate from (left, bottom) on, whose truth is the plate.
NamedMap map_of(const std::string& name, MapRegion region, float error = 0.1F) {
  const Plate plate = Plate::named(name);
  NamedMap map{.name = name, .cells = {.region = region, .values = {}, .errors = {}}, .cell_mm = kCellMm};
  for (std::int64_t j = region.bottom; j < region.bottom + region.height; ++j)
    for (std::int64_t i = region.left; i < region.left + region.width; ++i)
      map.truth.push_back(static_cast<float>(truth_value(plate, (static_cast<double>(i) + 0.5) * kCellMm,
                                                         (static_cast<double>(j) + 0.5) * kCellMm)));
  map.cells.values = map.truth;
  map.cells.errors.assign(map.truth.size(), error);
  return map;
}

const MapRegion kPlate = {0, 0, 48, 144};

TEST(Elements, OfThePlatesLieWhereTheirCrestsDo) {
  for (const char* name : {"3_Bumps", "6_Bumps", "4_Ridges", "6_Ridges"}) {
    const Plate plate = Plate::named(name);
    const std::vector<Element> found = elements(map_of(name, kPlate));
    ASSERT_EQ(found.size(), plate.crests().size()) << name;
    for (std::size_t i = 0; i < found.size(); ++i) {
      EXPECT_NEAR(found[i].y_mm, plate.crests()[i], 0.05) << name;
      EXPECT_TRUE(found[i].line() && found[i].open) << name;
      EXPECT_NEAR(found[i].length_mm, 36, 0.1);
      EXPECT_NEAR(found[i].along_x, 1, 1e-9);
    }
    EXPECT_NEAR(pitch_mm(found), plate.textures()[0].pitch_mm, 0.1) << name;
  }
}

TEST(Elements, BlobsAreRoundAndCounted) {
  const std::vector<Element> found = elements(map_of("blobs12h3", kPlate));
  ASSERT_EQ(found.size() % 3, 0U);
  for (const Element& e : found) EXPECT_TRUE(!e.line() && !e.open);
  EXPECT_NEAR(pitch_mm(found), 12, 0.3);
  EXPECT_NEAR(found[0].width_mm, 2 * 3 * 0.75, 0.4);  // a disc as wide as half a ball at half its height
}

TEST(Elements, NoiseBelowHalfOfATopMakesNone) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const RandomStream random(seed, 0);
    NamedMap map = map_of(seed % 2 == 0 ? "4_Ridges" : "6_Bumps", kPlate);
    for (std::size_t c = 0; c < map.truth.size(); ++c)
      map.cells.values[c] += 0.1F * static_cast<float>(random.uniform(c) - 0.5);
    ElementScores scores;
    scores.add(map);
    EXPECT_EQ(scores.found, scores.existing);
    EXPECT_EQ(scores.invented, 0U) << seed;
    EXPECT_LT(median(std::vector(scores.distances_mm)), 0.1);
  }
}

TEST(Elements, AreNoneWhereTheirIntervalReachesTheFloor) {
  EXPECT_EQ(elements(map_of("4_Ridges", kPlate, 0.69F)).size(), 4U);
  EXPECT_TRUE(elements(map_of("4_Ridges", kPlate, 0.71F)).empty());  // a pixel of a ridge's top has 0.7
}

TEST(Elements, AMoveOfAMillimetreIsFoundAndThreeAreNot) {
  for (const std::int64_t cells : {1, 4}) {
    NamedMap map = map_of("4_Ridges", kPlate);
    std::ranges::rotate(map.cells.values, map.cells.values.begin() + cells * kPlate.width);
    ElementScores scores;
    scores.add(map);
    EXPECT_EQ(scores.existing, 4U);
    EXPECT_EQ(scores.found, cells == 1 ? 4U : 0U);
    EXPECT_LT(scores.pitch_errors_mm.at(0), 0.01);
    EXPECT_EQ(scores.invented, cells == 1 ? 0U : 4U);
  }
}

TEST(Elements, WhatWasNotFeltDoesNotExist) {
  NamedMap map = map_of("3_Bumps", kPlate);
  for (std::size_t c = map.truth.size() / 2; c < map.truth.size(); ++c)
    map.cells.values[c] = map.cells.errors[c] = std::numeric_limits<float>::quiet_NaN();
  ElementScores scores;
  scores.add(map);
  EXPECT_EQ(scores.existing, elements(map).size());
  EXPECT_EQ(scores.found, scores.existing);
}

TEST(Elements, OfAnEmptyOrFlatMapAreNone) {
  EXPECT_TRUE(elements(NamedMap{.name = "", .cells = {}, .cell_mm = kCellMm}).empty());
  NamedMap none = map_of("plain", kPlate);
  recognise(none, kinds_of_elements(kAnyKind));
  EXPECT_TRUE(elements(none).empty());
  EXPECT_EQ(elements_text(none), "0 elements");
}

// Of a cell of a map, the largest of what is drawn and what is true; edges of ridges and bumps are steep.
float furthest(const NamedMap& map) {
  float most = 0;
  for (std::size_t c = 0; c < map.truth.size(); ++c)
    most = std::max(most, std::abs(map.cells.values[c] - map.truth[c]));
  return most;
}

TEST(Elements, AreDrawnAsTheirKindWhateverTheirWidth) {
  // Each kind is felt as the other: places are right, widths are not.
  for (const auto& [felt, there, kind] :
       {std::tuple("bumps9", "4_Ridges", "ridges"), std::tuple("ridges12", "3_Bumps", "bumps"),
        std::tuple("blobs12h1.5", "blobs12h3", "blobs36h3")}) {
    NamedMap map = map_of(felt, kPlate);
    map.truth = map_of(there, kPlate).truth;
    EXPECT_GT(furthest(map), 0.5F) << felt;
    map.cells.values[5] = std::numeric_limits<float>::quiet_NaN();
    draw_as(map, kinds_of_elements(kind));
    EXPECT_TRUE(std::isnan(map.cells.values[5]) && std::isnan(map.cells.errors[5]));
    map.cells.values[5] = map.truth[5];
    EXPECT_LT(furthest(map), 0.07F) << felt;
    for (std::size_t c = 6; c < map.truth.size(); ++c)
      EXPECT_LE(std::abs(map.cells.values[c] - map.truth[c]), map.cells.errors[c] + 0.03F) << felt;
  }
}

TEST(Elements, AreOfTheKindThatDiffersLeast) {
  for (const auto& [plate, kind] :
       {std::pair("3_Bumps", "bumps"), std::pair("6_Bumps", "bumps"), std::pair("4_Ridges", "ridges"),
        std::pair("6_Ridges", "ridges"), std::pair("blobs12h2.5", "blobs")}) {
    NamedMap map = map_of(plate, kPlate, 0.3F);
    const RandomStream random(1, 0);
    for (std::size_t c = 0; c < map.truth.size(); ++c)
      map.cells.values[c] += 0.2F * static_cast<float>(random.uniform(c) - 0.5);
    recognise(map, kinds_of_elements(kAnyKind));
    EXPECT_EQ(map.kind, kind) << plate;
    EXPECT_GT(map.kind_share, 0.9) << plate;
    recognise(map, kinds_of_elements(kind == std::string("ridges") ? "bumps" : "ridges"));
    EXPECT_LT(map.kind_share, 0.7) << plate;
    draw_as(map, kinds_of_elements(kAnyKind));
    EXPECT_EQ(map.kind, kind) << plate;
  }
}

TEST(Elements, TheirKindIsOneElementOnAFlatPlate) {
  EXPECT_EQ(kinds_of_elements("bumps")[0].max_height(), 2.5);
  for (const char* name : {"3_Bumps", "waves", "plain36", "bumps12"})
    EXPECT_THROW(kinds_of_elements(name), std::invalid_argument) << name;
}

TEST(Elements, HoldTheirPlaceWithinWhatTheySay) {
  // Errors of neighbours are alike: a tilt across a ridge moves its middle by no more than off_mm.
  NamedMap map = map_of("4_Ridges", kPlate, 0.3F);
  for (std::size_t c = 0; c < map.truth.size(); ++c) map.cells.values[c] *= (c / 48) % 2 == 0 ? 1.3F : 0.7F;
  const std::vector<Element> truth = elements(map_of("4_Ridges", kPlate)), found = elements(map);
  ASSERT_EQ(found.size(), truth.size());
  for (std::size_t i = 0; i < found.size(); ++i)
    EXPECT_LE(std::abs(found[i].y_mm - truth[i].y_mm), found[i].y_off_mm);
}

NamedMap small_map() {
  SurfaceMap map(ImageGrid{4, 4, Pitch(1, 2)});
  std::vector<float> picture(16), errors(16, 0.1F);
  for (std::size_t p = 0; p < 16; ++p) picture[p] = 0.05F * static_cast<float>(p);
  map.add(2, 4, picture, errors);
  map.add(12, 4, picture, errors);  // six columns between are not felt
  return {.name = "plate_t1", .cells = map.cells(map.felt()), .cell_mm = map.grid().pixel_mm};
}

struct MapFiles : testing::Test {
  std::string path(const std::string& ending) {
    return (std::filesystem::path(testing::TempDir()) / ("map_file_test" + ending)).string();
  }
};

TEST_F(MapFiles, TensorsComeBackWithTheirPlace) {
  const NamedMap map = small_map();
  write_maps(path(".safetensors"), {map});
  const SafetensorsFile file = SafetensorsFile::read(path(".safetensors"));
  EXPECT_EQ(file.metadata().at("cell_mm"), "[1,2]");
  EXPECT_EQ(file.metadata().at("plate_t1.corner_mm"), "[0,0]");
  const std::vector<float> values = file.f32("plate_t1.values");
  ASSERT_EQ(values.size(), 4U * 14U);
  EXPECT_NEAR(values[0], 0, 1e-6);
  EXPECT_NEAR(values[14 + 13], 0.35, 1e-6);
  EXPECT_TRUE(std::isnan(values[5]));
  EXPECT_NEAR(file.f32("plate_t1.errors")[0], 0.1, 1e-6);
}

// That it is closed, PlateMesh shows in stl_test.cpp.
TEST_F(MapFiles, TheSolidIsAsHighAsItSays) {
  write_maps(path(".stl"), {small_map()});
  float highest = -100, lowest = 100;
  int sunk = 0;
  for (const Triangle& t : read_stl(path(".stl"))) {
    for (const Vertex& v : t) {
      highest = std::max(highest, v[2]), lowest = std::min(lowest, v[2]);
      sunk += v[2] == static_cast<float>(-kSunkMm) ? 1 : 0;
    }
  }
  EXPECT_NEAR(highest, 2.5 * 0.75, 1e-5);
  EXPECT_NEAR(lowest, -4, 1e-5);
  EXPECT_GT(sunk, 0);
}

TEST_F(MapFiles, APictureIsWritten) {
  write_maps(path(".png"), {small_map(), small_map()});
  EXPECT_GT(std::filesystem::file_size(path(".png")), 1000U);
}

TEST_F(MapFiles, SaysWhatIsWrong) {
  EXPECT_ERROR(write_maps(path(".npy"), {small_map()}), std::invalid_argument,
               "a map is written as .png, .safetensors, .csv or .stl, found ");
  EXPECT_REFUSAL(
      "write_maps: maps expects the surface of one plate for .stl, got 2; choose one plate, or write "
      ".safetensors",
      write_maps(path(".stl"), {small_map(), small_map()}));
  EXPECT_REFUSAL("write_maps: maps expects 1 or more, got 0", write_maps(path(".png"), {}));
}

}  // namespace supertac::named_map_test
