// STL files: triangles in mm, written binary, read in both forms; the surface that they make, and the
// triangles of a plate.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "data/plates/plate.h"

namespace supertac {

using Vertex = std::array<float, 3>;  ///< (x, y, z) in mm
/// Corners counter-clockwise seen from outside.
using Triangle = std::array<Vertex, 3>;

constexpr std::uint64_t kMaxStlBytes = 512 << 20;  ///< read and written
constexpr float kMaxStlCoordinateMm = 1e6F;        ///< beyond any printer, and a sum could overflow

/// The triangles of an STL file held in memory. A file is binary when its length is that of its count,
/// 84 + 50 n bytes, whatever its first word; else it is text when it begins with "solid", whatever case,
/// spaces or byte-order mark, and has no zero byte. Normals and attributes are not used; the text may hold
/// several solids and nothing else, lines end with LF, CR or both.
/// `name`: of the file, for messages
/// Throws FileError, naming the byte or the line: no STL, cut off, another count than the length allows, no
/// triangle, coordinates that are no numbers or beyond kMaxStlCoordinateMm. No count is believed before it
/// has been compared with the length.
std::vector<Triangle> parse_stl(std::span<const std::byte> bytes, const std::string& name);

/// The same from a file of at most kMaxStlBytes.
std::vector<Triangle> read_stl(const std::string& path);

/// A binary STL file's bytes, normals left at 0, which readers take from the corners (right-hand rule);
/// `title` goes into its 80-byte header; "solid" does not begin it, which marks a text file. Throws
/// std::invalid_argument for more triangles than kMaxStlBytes hold.
std::vector<std::byte> stl_bytes(const std::vector<Triangle>& triangles, std::string_view title);

/// The upper surface of a model read from triangles, on a grid, as a surface to slide over. z = 0 is its flat
/// part, taken as the median height along its outline; what is less than 1 um from it counts as flat. Its
/// extent():
///   texture_begin, _end  the nodes before the first and behind the last that differ from the flat part; the
///                        middle when none does
///   uniform_in_x         no height differs by more than 0.05 mm from the mean of its row
///   crests               where the mean height over x, as a function of y, stays above half its maximum: the
///                        middle of each such stretch's highest part. Elements that run into each other above
///                        half their height count as one.
class HeightMap {
 public:
  static constexpr double kCellMm = 0.125;  ///< spacing of the grid
  static constexpr std::size_t kColumns = static_cast<std::size_t>(rig::kPlateWidthMm / kCellMm) + 1,
                               kRows = static_cast<std::size_t>(rig::kPlateLengthMm / kCellMm) + 1;

  /// The highest point of the triangles above every node of the grid, walls and overhangs included. The
  /// model may lie anywhere; its extent must be a plate's, within 0.1 mm.
  /// `name`: of the file, for messages
  /// Throws FileError naming found and expected extent; a hole (nodes below no triangle); or triangles that
  /// lie over each other more often than those of any printed part.
  HeightMap(const std::vector<Triangle>& triangles, const std::string& name);

  /// Height (mm) at (x, y): bilinear between the nodes; 0 outside.
  double operator()(double x_mm, double y_mm) const;
  const PlateExtent& extent() const { return extent_; }

 private:
  std::vector<float> z_;  // [rows][columns]
  PlateExtent extent_;

  float at(std::size_t row, std::size_t column) const { return z_[row * kColumns + column]; }
  double row_mean(std::size_t row) const;
  void level();
  void measure();
  void find_crests();
};

/// Material of a solid below its lowest point.
inline constexpr double kSolidBaseMm = 3;

/// A surface as a solid: its points [rows][columns] over a rectangle, in lines along x and y that ascend,
/// four walls, and a flat bottom at z = `bottom`. Closed and manifold (every edge belongs to two triangles,
/// in opposite directions), outside by the right-hand rule. There must be two lines of each at least.
std::vector<Triangle> solid_under(const std::vector<Vertex>& points, std::size_t columns, float bottom);

/// The plate as a solid to print, in its own coordinates: solid_under() its textured top. Heights are exact
/// at points HeightMap::kCellMm apart in the textured part, and straight between them; lines along x are
/// placed on every crest and where the texture begins and ends, so that peaks keep their height. A plate that
/// was read from STL is the same plate when it is written and read again. A texture that varies along y only
/// has no points between its sides.
std::vector<Triangle> mesh_of(const Plate& plate);

}  // namespace supertac
