#pragma once

#include <memory>
#include <string>
#include <vector>

#include "data/plates/surface.h"
#include "data/sensors/rig.h"

namespace supertac {

/// One texture of a plate: equal elements, pitch_mm apart, 0 between them. Ridges are triangular, 2.5 mm wide
/// at most; bumps half cylinders, blobs half spheres, twice as wide as high; waves a cosine.
struct Texture {
  std::string kind = "plain";  ///< or ridges, bumps, waves (lines along x) or blobs
  double pitch_mm = 0;         ///< distance between neighbouring centres
  double height_mm = 0;        ///< of the highest point above the plate's base
  /// The texture is laid out in [from, to], centred, as many elements as fit whole.
  double from_mm = rig::kTextureFromMm, to_mm = rig::kTextureToMm;
};

/// The surface the finger slides over: rig::kPlateWidthMm (x) by kPlateLengthMm (y), with its texture in the
/// middle third. Coordinates are the plate's own, origin at its corner; z = 0 is its flat part.
class Plate {
 public:
  /// A plate by name. Plates of the rig: 3_Bumps, 6_Bumps, 4_Ridges, 6_Ridges, 4_Waves, 6_Waves, 4_Blob,
  /// 6_Blob. Others: "plain", or KIND PITCH [h HEIGHT] in mm ("bumps12", "ridges6h1.5"), or several joined by
  /// '+', which share the length equally ("bumps12+ridges4"), or "random" and a number, the plate that
  /// random_plate() draws for it. Default height rig::kTextureHeightMm, for round elements (bumps, blobs) at
  /// most pitch / 2. Or the path of an STL file of a plate's size (data/plates/height_map.h), whose plate has
  /// the file's name without folders. Throws std::invalid_argument naming the part that could not be read;
  /// FileError for an STL file.
  static Plate named(const std::string& name);
  /// True when the name is that of an STL file: it ends with ".stl".
  static bool is_file(const std::string& name);

  /// `textures` must not overlap; empty means plain. Throws std::invalid_argument when pitch or height are
  /// not positive or do not fit.
  Plate(std::string name, const std::vector<Texture>& textures);

  /// A plate of that size. Copies share the surface.
  Plate(std::string name, std::shared_ptr<const Surface> surface);

  /// Surface height z (mm) at (x, y); negative in the troughs of waves, 0 outside the texture.
  double height(double x_mm, double y_mm) const { return surface_->height(x_mm, y_mm); }

  /// Highest and lowest z of the plate (mm): 0 and 0 when plain; lowest is -h for waves, else 0.
  double max_height() const { return surface_->extent().max_height; }
  double min_height() const { return surface_->extent().min_height; }

  /// Where the texture begins and ends along y (mm); both the middle of the plate when plain.
  double texture_begin() const { return surface_->extent().texture_begin; }
  double texture_end() const { return surface_->extent().texture_end; }

  /// Where the elements' highest lines or rows of centres (maps: HeightMap) lie along y (mm),
  /// ascending; empty when plain.
  const std::vector<double>& crests() const { return surface_->extent().crests; }

  /// True when the height depends on y only (a map: within 0.05 mm).
  bool uniform_in_x() const { return surface_->extent().uniform_in_x; }

  const std::string& name() const { return name_; }
  /// Regular textures, one after the other, plain ones left out; empty for another surface.
  const std::vector<Texture>& textures() const { return textures_; }

 private:
  std::string name_;
  std::shared_ptr<const Surface> surface_;
  std::vector<Texture> textures_ = {};
};

/// Names of the eight plates of the rig, and of the six that simulations use by default (the paper's bumps
/// and ridges at 12, 6 and 4 mm).
std::vector<std::string> rig_plates();
const std::vector<std::string>& default_plates();

}  // namespace supertac
