#pragma once

#include <vector>

namespace supertac {

/// What a plate measures, in mm; members mean what they mean in Plate.
struct PlateExtent {
  double max_height = 0, min_height = 0;
  /// Along y, what lies before the one and behind the other is flat, at 0, unless the plate ends there.
  double texture_begin = 0, texture_end = 0;
  bool uniform_in_x = true;
  std::vector<double> crests = {};
};

/// The shape of a plate: rows of equal elements, the height map of an STL file, or what random_plate() draws.
class Surface {
 public:
  virtual ~Surface() = default;
  virtual double height(double x_mm, double y_mm) const = 0;
  const PlateExtent& extent() const { return extent_; }

 protected:
  PlateExtent extent_;
};

}  // namespace supertac
