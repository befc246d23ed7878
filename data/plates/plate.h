// Textured plates: what lies where, by name, by number or from a file.
#pragma once

#include <cstdint>
#include <functional>
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

/// The shape of a plate, z (mm) at (x, y): rows of equal elements, the height map of an STL file, or what
/// random_plate() draws.
using Surface = std::function<double(double x_mm, double y_mm)>;

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
  /// most pitch / 2. Or the path of an STL file of a plate's size (data/plates/stl.h), whose plate has
  /// the file's name without folders. Throws std::invalid_argument naming the part that could not be read;
  /// FileError for an STL file.
  static Plate named(const std::string& name);
  /// True when the name is that of an STL file: it ends with ".stl".
  static bool is_file(const std::string& name);

  /// `textures` must not overlap; empty means plain. Throws std::invalid_argument when pitch or height are
  /// not positive or do not fit.
  Plate(std::string name, const std::vector<Texture>& textures);

  /// A plate of any surface with this extent. Copies share the surface.
  Plate(std::string name, Surface surface, PlateExtent extent);

  /// Surface height z (mm) at (x, y); negative in the troughs of waves, 0 outside the texture.
  double height(double x_mm, double y_mm) const { return (*surface_)(x_mm, y_mm); }

  /// Highest and lowest z of the plate (mm): 0 and 0 when plain; lowest is -h for waves, else 0.
  double max_height() const { return extent_.max_height; }
  double min_height() const { return extent_.min_height; }

  /// Where the texture begins and ends along y (mm); both the middle of the plate when plain.
  double texture_begin() const { return extent_.texture_begin; }
  double texture_end() const { return extent_.texture_end; }

  /// Where the elements' highest lines or rows of centres (maps: HeightMap) lie along y (mm),
  /// ascending; empty when plain.
  const std::vector<double>& crests() const { return extent_.crests; }

  /// True when the height depends on y only (a map: within 0.05 mm).
  bool uniform_in_x() const { return extent_.uniform_in_x; }

  const std::string& name() const { return name_; }
  /// Regular textures, one after the other, plain ones left out; empty for another surface.
  const std::vector<Texture>& textures() const { return textures_; }

 private:
  std::string name_;
  std::shared_ptr<const Surface> surface_;
  PlateExtent extent_;
  std::vector<Texture> textures_ = {};
};

/// The plate called "random<number>": what networks for unseen plates are trained and tested on. Kind, layout
/// and sizes are drawn from the number alone:
///   plain                                                            1 in 16
///   equal elements in rows (ridges, bumps, blobs, waves), or two such textures one behind the other
///   lines with a pitch of their own each, some oblique; single lines; scattered round elements; smooth hills
/// Pitches 4 to 15 mm, heights 0.5 to 3 mm; more than half of the lines and rounds are of the rig's size.
Plate random_plate(std::uint32_t number);

/// True when both have a texture of the same kind whose pitches differ by less than half a millimetre: a
/// network that is trained on one has seen the other.
bool resemble(const Plate& a, const Plate& b);

// Plates that come from a file. A recording names its plate; when that is an STL file, the file lies beside
// the recording, so that a folder of recordings holds all that training needs and can be moved.

/// True for the name of a plate of unknown shape: it begins with "unknown". Its recordings can be streamed
/// and drawn; they have no truth, so nothing can be learnt from them or scored.
bool is_unknown_plate(const std::string& name);

/// The plate that `name` means for recordings of `folder`: one of Plate::named, or an STL file there.
/// Throws std::invalid_argument for an unknown plate, or an STL file named with a folder (a recording must
/// not choose which file is read); FileError when the file is missing or no plate.
Plate plate_in_folder(const std::string& name, const std::string& folder);

/// Puts the STL file `path` into `folder` under its own name, so that plate_in_folder() finds it. Does
/// nothing for a plate that is no file, or when the same bytes are there already.
/// Throws FileError when another plate has that name there.
void keep_plate_file(const std::string& path, const std::string& folder);

}  // namespace supertac
