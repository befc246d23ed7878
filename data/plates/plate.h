#pragma once

#include <memory>
#include <string>
#include <vector>

#include "data/plates/surface.h"
#include "data/sensors/rig.h"

namespace supertac {

struct TextureKind;  // what an element looks like (plate.cpp)

/// One texture of a plate: equal elements, pitch_mm apart, 0 between them. Ridges are triangular, 2.5 mm wide
/// at most; bumps half cylinders, blobs half spheres, twice as wide as high; waves a cosine.
struct Texture {
  std::string kind = "plain";  ///< or ridges, bumps, waves (lines along x) or blobs
  double pitch_mm = 0;         ///< distance between neighbouring centres
  double height_mm = 0;        ///< of the highest point above the plate's base
  /// The texture is laid out in [from, to], centred, as many elements as fit whole.
  double from_mm = rig::kTextureFromMm, to_mm = rig::kTextureToMm;
};

/// The surface the finger slides over: kWidthMm (x) by kLengthMm (y), with its texture in the middle third.
/// Coordinates are the plate's own, origin at its corner; z = 0 is its flat part.
class Plate {
 public:
  static constexpr double kWidthMm = rig::kPlateWidthMm, kLengthMm = rig::kPlateLengthMm;

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

  /// A plate of kWidthMm x kLengthMm that is no row of textures. Copies share the surface.
  Plate(std::string name, std::shared_ptr<const Surface> surface);

  /// Surface height z (mm) at (x, y); negative in the troughs of waves, 0 outside the texture.
  double height(double x_mm, double y_mm) const;

  /// Highest and lowest z of the plate (mm): 0 and 0 when plain; lowest is -h for waves, else 0.
  double max_height() const { return max_height_; }
  double min_height() const { return min_height_; }

  /// Where the texture begins and ends along y (mm); both the middle of the plate when plain.
  double texture_begin() const { return texture_begin_; }
  double texture_end() const { return texture_end_; }

  /// Where the elements' highest lines or rows of centres (maps: HeightMap::crests) lie along y (mm),
  /// ascending; empty when plain.
  std::vector<double> crests() const;

  /// True when the height depends on y only (a map: within 0.05 mm).
  bool uniform_in_x() const;

  const std::string& name() const { return name_; }
  /// Regular textures, one after the other; empty for a Surface.
  std::vector<Texture> textures() const;

 private:
  struct Band {  // one texture with its layout worked out
    Texture texture;
    const TextureKind* kind = nullptr;
    int count_y = 0, count_x = 0;
    double first_y = 0, first_x = 0;  // centre of the first element
    double begin = 0, end = 0;        // extent along y
    double height(double x_mm, double y_mm) const;
  };
  static Band lay_out(const Texture& texture, const TextureKind& kind);

  std::string name_;
  std::vector<Band> bands_;
  std::shared_ptr<const Surface> surface_;  // instead of bands
  double max_height_ = 0, min_height_ = 0, texture_begin_ = 0, texture_end_ = 0;
};

/// Names of the eight plates of the rig, and of the six that simulations use by default (the paper's bumps
/// and ridges at 12, 6 and 4 mm).
std::vector<std::string> rig_plates();
const std::vector<std::string>& default_plates();

}  // namespace supertac
