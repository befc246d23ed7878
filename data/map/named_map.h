// A map with its name: its files, and its hills with their places, sizes and how sure they are.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "data/map/surface_map.h"
#include "data/plates/plate.h"
#include "io/files/file.h"

namespace supertac {

struct NamedMap {
  std::string name;
  MapCells cells;  ///< its errors as half of each cell's 90 % interval
  Pitch cell_mm;
  std::vector<float> truth = {};  ///< of the cells, where it is known
  std::string kind = {};          ///< that its elements resemble most: recognise(); empty: not asked
  double kind_share = 0;          ///< how well
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
///   .csv          a row for each element (elements()) of each map, lengths in mm; kind of its map
///   .stl          one map as a solid to print, 1 being rig::kTextureHeightMm high, as far above its bottom
///                 as a plate's (data/plates/stl.h); what was never felt lies kSunkMm below the plane
/// Throws std::invalid_argument as check_map_path(), for no map, or more than one for .stl; FileError.
void write_maps(const OutputPath& output, const std::vector<NamedMap>& maps);

inline constexpr double kSunkMm = 1;

/// A hill of a map: the cells around a top that are at least half as high.
struct Element {
  double x_mm = 0, y_mm = 0;           ///< mean of its cells, weighted by their values
  double x_off_mm = 0, y_off_mm = 0;   ///< how far that may be off
  double height = 0, height_off = 0;   ///< of the top; half of its 90 % interval
  double length_mm = 0, width_mm = 0;  ///< of the bar that has the same moments
  double along_x = 1, along_y = 0;     ///< unit vector of its length, along_x >= 0
  bool open = false;                   ///< reaches the edge of what was felt, so may go on
  bool line() const { return length_mm >= 2 * width_mm; }
};

/// Its numbers as tables have them: x_mm, y_mm, x_off_mm, y_off_mm, height, height_off, length_mm, width_mm,
/// degrees, open.
std::vector<std::pair<const char*, double>> numbers_of(const Element& element);

/// Hills in the sense of persistence (Edelsbrunner, Letscher, Zomorodian 2002): two tops are one hill when
/// the saddle between them is at least half as high as the lower top. Hills lower than kLowest, or lower than
/// their own interval, are none. With cells c of values v and half widths e of intervals,
///   centre = sum v c / sum v,   off = sum e |c - centre| / sum v,
/// the latter for errors of the worst signs, since errors of neighbours are alike. Ordered by y, then x.
std::vector<Element> elements(const NamedMap& map);
inline constexpr float kLowest = 0.2F;

/// The median distance of an element from its nearest neighbour (mm), measured across them where they are
/// lines; NaN below two.
double pitch_mm(const std::vector<Element>& elements);

/// Like: 6 elements, 5.99 mm apart, most like ridges, which explain 97 % of it
std::string elements_text(const NamedMap& map);

/// What a user states of the elements: bumps, ridges or blobs, a plate with one element in its middle (as
/// Plate::named(), an STL file too), or kAnyKind, which is each of the first three. Throws as Plate::named(),
/// and std::invalid_argument for waves and for another number of elements.
std::vector<Plate> kinds_of_elements(const std::string& name);
inline constexpr const char* kAnyKind = "any";

/// Which of `kinds` a map's elements resemble: the map differs least (mean square) from plate_of() that kind.
/// Sets map.kind to its name, and map.kind_share to the share of cells, of those where the map or that plate
/// is at least half of kLowest high, that lie within the map's interval of it. Of no elements there is no
/// kind.
const Plate& recognise(NamedMap& map, const std::vector<Plate>& kinds);

/// A plate with an element of `kind` in each place; where several reach, the highest. Lines lie along x, as
/// on every plate, and go on beyond what was felt.
Plate plate_of(const std::vector<Element>& found, const Plate& kind);

/// Draws the map anew: what was felt becomes plate_of(elements(map), recognise(map, kinds)), and the error of
/// a cell the largest change there over the four moves of all places by (+-x_off_mm, +-y_off_mm).
void draw_as(NamedMap& map, const std::vector<Plate>& kinds);

/// How the elements of a map stand beside those of its truth, taken in the same way: a true one is found when
/// one that no other has taken lies within kFoundMm, measured across lines; what is left over is false.
struct ElementScores {
  static constexpr double kFoundMm = 1;
  std::size_t existing = 0, found = 0, invented = 0;
  std::vector<double> distances_mm = {};     ///< of those found
  std::vector<double> pitch_errors_mm = {};  ///< of maps with a pitch

  /// A map with truth.
  void add(const NamedMap& map);
};

}  // namespace supertac
