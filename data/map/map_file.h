// Files of maps.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "data/map/surface_map.h"
#include "io/files/file.h"

namespace supertac {

struct NamedMap {
  std::string name;
  MapCells cells;  ///< its errors as half of each cell's 90 % interval
  Pitch cell_mm;
  std::vector<float> truth = {};  ///< of the cells, where it is known
  std::string kind = {};  ///< that its elements resemble most: recognise() of elements.h; empty: not asked
  double kind_share = 0;  ///< how well
};

/// Of a cell (mm), x and y.
std::pair<double, double> centre_of(const NamedMap& map, std::size_t cell);

/// Throws std::invalid_argument unless `path` ends with one of the endings of write_maps().
void check_map_path(const std::string& path);

/// By the ending of its name:
///   .png          y to the right and x upwards: each map above its error and its truth, in the same colours,
///                 with a scale bar; what was never felt is grey
///   .safetensors  for each map NAME.values, NAME.errors and NAME.truth F32 [height][width], NaN where
///                 nothing was felt; metadata NAME.corner_mm is the place of the corner of the first cell,
///                 cell_mm the size of a cell, [x,y] both
///   .csv          a row for each element (data/map/elements.h) of each map, lengths in mm; kind of its map
///   .stl          one map as a solid to print, 1 being rig::kTextureHeightMm high, as far above its bottom
///                 as a plate's (data/plates/stl.h); what was never felt lies kSunkMm below the plane
/// Throws std::invalid_argument as check_map_path(), for no map, or more than one for .stl; FileError.
void write_maps(const OutputPath& output, const std::vector<NamedMap>& maps);

inline constexpr double kSunkMm = 1;

}  // namespace supertac
