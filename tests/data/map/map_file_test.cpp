#include "data/map/map_file.h"

#include "data/plates/stl.h"
#include "io/files/safetensors.h"
#include "tests/support/test.h"

namespace supertac::map_file_test {

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

TEST_F(MapFiles, TheSolidIsClosedAndAsHighAsItSays) {
  write_maps(path(".stl"), {small_map()});
  std::map<std::pair<std::array<float, 3>, std::array<float, 3>>, int> edges;
  float highest = -100, lowest = 100;
  int sunk = 0;
  for (const Triangle& t : read_stl(path(".stl"))) {
    for (std::size_t k = 0; k < 3; ++k) {
      ++edges[{t[k], t[(k + 1) % 3]}], --edges[{t[(k + 1) % 3], t[k]}];
      highest = std::max(highest, t[k][2]), lowest = std::min(lowest, t[k][2]);
      sunk += t[k][2] == static_cast<float>(-kSunkMm) ? 1 : 0;
    }
  }
  for (const auto& [edge, balance] : edges) EXPECT_EQ(balance, 0);
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
  EXPECT_ERROR(write_maps(path(".stl"), {small_map(), small_map()}), std::invalid_argument,
               "of one surface, found 2");
  EXPECT_ERROR(write_maps(path(".png"), {}), std::invalid_argument, "expected at least one, got none");
}

}  // namespace supertac::map_file_test
