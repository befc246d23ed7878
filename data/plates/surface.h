#pragma once

#include <vector>

namespace supertac {

/// The shape of a plate that is no row of equal elements: the height map of an STL file, or what
/// random_plate() draws. Lengths in mm; members mean what they mean in Plate.
class Surface {
 public:
  virtual ~Surface() = default;
  virtual double height(double x_mm, double y_mm) const = 0;
  virtual double max_height() const = 0;
  virtual double min_height() const = 0;
  /// Along y, what lies before the one and behind the other is flat, at 0, unless the plate ends there.
  virtual double texture_begin() const = 0;
  virtual double texture_end() const = 0;
  virtual bool uniform_in_x() const = 0;
  virtual std::vector<double> crests() const = 0;
};

}  // namespace supertac
