#include "data/map/named_map.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "data/plates/stl.h"
#include "io/files/safetensors.h"
#include "io/images/images.h"
#include "io/numbers/numbers.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr int kLongestPixels = 720, kMostCellPixels = 8, kGap = 6;
constexpr Rgb kGrey = {200, 200, 200}, kBlack = {0, 0, 0};

// What a map says of each of its cells: its name in files, and in pictures.
struct Part {
  const char* name;
  std::string heading;
  std::span<const float> cells;
};

std::vector<Part> parts_of(const NamedMap& map) {
  std::vector<Part> parts = {{"values", map.name, map.cells.values}};
  if (!map.cells.errors.empty()) parts.push_back({"errors", "off by", map.cells.errors});
  if (!map.truth.empty()) parts.push_back({"truth", "true", map.truth});
  return parts;
}

// y to the right, x upwards.
void draw(Picture& picture, int top, const MapRegion& region, std::span<const float> cells, int dots) {
  const auto columns = static_cast<int>(region.height), rows = static_cast<int>(region.width);
  for (int y = 0; y < rows * dots; ++y) {
    for (int x = 0; x < columns * dots; ++x) {
      const float value = cells[static_cast<std::size_t>(x / dots * rows + rows - 1 - y / dots)];
      picture.set(x, top + y, std::isnan(value) ? kGrey : colour_of(value));
    }
  }
}

// The longest of 1, 2, 5, 10 ... mm that is at most a quarter of the picture.
void draw_scale(Picture& picture, int top, double dots_a_mm) {
  double mm = 0.01;
  for (int i = 0; i < 24; ++i) {
    const double next = mm * (i % 3 == 1 ? 2.5 : 2);
    if (next * dots_a_mm > picture.width / 4.0) break;
    mm = next;
  }
  const int length = std::max(1, static_cast<int>(mm * dots_a_mm));
  for (int x = 0; x < length; ++x)
    for (int y = 0; y < 4; ++y) picture.set(x, top + y, kBlack);
  draw_text(picture, 0, top + 8, format(mm) + " mm");
}

Picture picture_of(const std::vector<NamedMap>& maps) {
  std::int64_t longest = 1, height = 8 + kLineHeight;
  for (const NamedMap& map : maps) longest = std::max(longest, map.cells.region.height);
  const auto dots = static_cast<int>(std::clamp<std::int64_t>(kLongestPixels / longest, 1, kMostCellPixels));
  for (const NamedMap& map : maps)
    height += static_cast<std::int64_t>(parts_of(map).size()) * (map.cells.region.width * dots + kGap);
  const std::int64_t width = std::max<std::int64_t>(longest * dots, 80);
  constexpr std::int64_t kMost = 65535;
  Picture inside(static_cast<int>(std::min(width, kMost + 1)), static_cast<int>(std::min(height, kMost + 1)));
  Captions captions{.title = "The surface that was felt, y to the right, x upwards",
                    .low = "0: flat plate",
                    .high = "1: plate's highest"};
  int top = 0;
  for (const NamedMap& map : maps)
    for (const auto& [name, heading, cells] : parts_of(map)) {
      draw(inside, top, map.cells.region, cells, dots);
      const int tall = static_cast<int>(map.cells.region.width) * dots;
      captions.rows.push_back({top + tall / 2, heading});
      top += tall + kGap;
    }
  draw_scale(inside, top + 2, dots / maps.front().cell_mm.y);
  return captioned(inside, captions);
}

std::string pair_text(double x, double y) { return "[" + format(x) + "," + format(y) + "]"; }

void write_tensors(const OutputPath& output, const std::vector<NamedMap>& maps) {
  std::map<std::string, std::string> metadata = {
      {"format", "supertac-map"}, {"cell_mm", pair_text(maps.front().cell_mm.x, maps.front().cell_mm.y)}};
  std::vector<TensorToWrite> tensors;
  for (const NamedMap& map : maps) {
    const MapRegion& r = map.cells.region;
    metadata[map.name + ".corner_mm"] =
        pair_text(static_cast<double>(r.left) * map.cell_mm.x, static_cast<double>(r.bottom) * map.cell_mm.y);
    const std::vector<std::uint64_t> shape = {static_cast<std::uint64_t>(r.height),
                                              static_cast<std::uint64_t>(r.width)};
    for (const auto& [part, heading, cells] : parts_of(map))
      tensors.push_back({map.name + "." + part, "F32", shape, std::as_bytes(cells)});
  }
  write_safetensors(output, metadata, tensors);
}

std::string table_of(const std::vector<NamedMap>& maps) {
  std::string table = "map,element";
  for (const auto& [name, number] : numbers_of({})) table += std::string(",") + name;
  table += ",kind,kind_share\n";
  for (const NamedMap& map : maps) {
    int count = 0;
    for (const Element& e : elements(map)) {
      table += map.name + "," + std::to_string(++count);
      for (const auto& [name, number] : numbers_of(e)) table += "," + format(number, 3);
      table += "," + map.kind + "," + format(map.kind_share, 3) + "\n";
    }
  }
  return table;
}

// With a point at each cell's centre.
std::vector<Triangle> solid_of(const NamedMap& map) {
  const double bottom = -kSunkMm - kSolidBaseMm;
  std::vector<Vertex> points;
  for (std::size_t c = 0; c < map.cells.values.size(); ++c) {
    const auto [x, y] = centre_of(map, c);
    const float value = map.cells.values[c];
    const double z = std::isnan(value) ? -kSunkMm : rig::kTextureHeightMm * double{value};
    points.push_back(
        {static_cast<float>(x), static_cast<float>(y), static_cast<float>(std::max(z, bottom + 0.1))});
  }
  return solid_under(points, static_cast<std::size_t>(map.cells.region.width), static_cast<float>(bottom));
}

}  // namespace

std::pair<double, double> centre_of(const NamedMap& map, std::size_t cell) {
  const auto i = static_cast<std::int64_t>(cell);
  const MapRegion& r = map.cells.region;
  return {(static_cast<double>(r.left + i % r.width) + 0.5) * map.cell_mm.x,
          (static_cast<double>(r.bottom + i / r.width) + 0.5) * map.cell_mm.y};
}

void check_map_path(const std::string& path) {
  for (const char* ending : {".png", ".safetensors", ".csv", ".stl"})
    if (path.ends_with(ending)) return;
  throw std::invalid_argument("a map is written as .png, .safetensors, .csv or .stl, found " + path);
}

void write_maps(const OutputPath& output, const std::vector<NamedMap>& maps) {
  check_map_path(output.path);
  if (maps.empty()) throw std::invalid_argument(refusal("write_maps", "maps", "1 or more", "0"));
  if (output.path.ends_with(".safetensors")) return write_tensors(output, maps);
  AtomicFile file(output);
  if (output.path.ends_with(".png")) {
    file.write(encode_png(picture_of(maps)));
  } else if (output.path.ends_with(".csv")) {
    file.write(table_of(maps));
  } else {
    if (maps.size() > 1)
      throw std::invalid_argument(
          refusal("write_maps", "maps", "the surface of one plate for .stl",
                  std::to_string(maps.size()) + "; choose one plate, or write .safetensors"));
    file.write(stl_bytes(solid_of(maps.front()), "map " + maps.front().name));
  }
  file.commit();
}

}  // namespace supertac
