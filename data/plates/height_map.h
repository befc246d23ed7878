#pragma once

#include <string>
#include <vector>

#include "data/plates/stl.h"
#include "data/plates/surface.h"

namespace supertac {

/// The upper surface of a model read from triangles, on a grid, as a surface to slide over. z = 0 is its flat
/// part, taken as the median height along its outline; what is less than 1 um from it counts as flat. Its
/// extent():
///   texture_begin, _end  the nodes before the first and behind the last that differ from the flat part; the
///                        middle when none does
///   uniform_in_x         no height differs by more than 0.05 mm from the mean of its row
///   crests               where the mean height over x, as a function of y, stays above half its maximum: the
///                        middle of each such stretch's highest part. Elements that run into each other above
///                        half their height count as one.
class HeightMap : public Surface {
 public:
  static constexpr double kCellMm = 0.125;  ///< spacing of the grid

  /// The highest point of the triangles above every node of the grid, walls and overhangs included. The
  /// model may lie anywhere; its extent must be width x length, within 0.1 mm.
  /// `name`: of the file, for messages
  /// Throws FileError naming found and expected extent; a hole (nodes below no triangle); or triangles that
  /// lie over each other more often than those of any printed part.
  HeightMap(const std::vector<Triangle>& triangles, double width_mm, double length_mm,
            const std::string& name);

  /// Bilinear between the nodes; 0 outside.
  double height(double x_mm, double y_mm) const override;

 private:
  std::size_t columns_ = 0, rows_ = 0;
  std::vector<float> z_;  // [rows][columns]

  float at(std::size_t row, std::size_t column) const { return z_[row * columns_ + column]; }
  double row_mean(std::size_t row) const;
  void level();
  void measure();
  void find_crests();
};

}  // namespace supertac
