#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "data/sensors/rig.h"

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

/// One texture of a plate: equal elements, pitch_mm apart, 0 between them. Ridges are triangular, 2.5 mm wide
/// at most; bumps half cylinders, blobs half spheres, twice as wide as high; waves a cosine.
struct Texture {
  std::string kind = "plain";  ///< or ridges, bumps, waves (lines along x) or blobs
  double pitch_mm = 0;         ///< distance between neighbouring centres
  double height_mm = 0;        ///< of the highest point above the plate's base
  /// The texture is laid out in [from, to], centred, as many elements as fit whole.
  double from_mm = rig::kTextureFromMm, to_mm = rig::kTextureToMm;
};

/// What is drawn for a random plate: regular textures, or a surface of its own; neither: a plain plate.
struct DrawnPlate {
  std::vector<Texture> textures = {};
  std::shared_ptr<const Surface> surface = {};
};

/// Kinds, layouts and sizes are drawn from the number alone:
///   plain                                                            1 in 16
///   equal elements in rows (ridges, bumps, blobs, waves), or two such textures one behind the other
///   lines with a pitch of their own each, some oblique; single lines; scattered round elements; smooth hills
/// Pitches 4 to 15 mm, heights .5 to 3 mm; more than half of the lines and rounds have the size of the rig's.
DrawnPlate draw_plate(std::uint32_t number);

}  // namespace supertac
