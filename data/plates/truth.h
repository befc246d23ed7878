// The truth of a picture: the plate under the finger, and what a picture holds of its texture.
#pragma once

#include <cstdint>
#include <span>

#include "data/plates/plate.h"
#include "data/sensors/taxel_array.h"

namespace supertac {

/// Height by the plate's own scale: z / max(max_height, -min_height). 0 is the flat plate, whatever else is
/// on it, 1 its highest point; the troughs of waves are negative. How deep the finger is pressed is not
/// known, so signals do not tell millimetres.
double truth_value(const Plate& plate, double x_mm, double y_mm);

/// The plate under the finger as an image [height][width] of truth_value at the centres of its pixels:
///   image[r * width + c] at x = x_mm - width p / 2 + (c + 1/2) p, y = y_mm - height q / 2 + (r + 1/2) q
/// with (p, q) = pixel_mm, a pixel's width and height. Row r grows with y, column c with x; (x_mm, y_mm) is
/// the finger's centre on the plate. Throws std::invalid_argument when a side is below 1 or image does not
/// hold height * width elements.
void truth_image(const Plate& plate, double x_mm, double y_mm, const ImageGrid& grid, std::span<float> image);

/// What lies under the finger. Scores are reported for each zone apart: a flat picture is easy where there is
/// no texture, and any texture drawn there is a ghost.
enum class Zone : std::uint8_t {
  contact,  ///< the picture holds texture
  near,     ///< it holds none, but the 3 mm around it do: the finger may feel some
  flat,     ///< on the plate, far from texture
  air,      ///< lifted clear of the plate
};

/// Of a finger on the plate at (x, y): contact, near or flat.
Zone zone_of(const Plate& plate, double x_mm, double y_mm, const ImageGrid& grid);

/// A frame is in contact when some texture lies under the array: its truth is not 0 everywhere; of a truth
/// that was measured, when a pixel shows more than `level`.
bool in_contact(std::span<const float> truth, float level = 0);

/// From which level on a truth that was measured is contact. Of a truth [frames][pixels] that a film or a
/// camera measured: its level at rest and six times its noise there. Both are taken from the pixels of the
/// tenth of the frames that sum to the least: their median, and how far their 95th percentile lies above it,
/// since noise is often cut off at 0. 0 where these frames are fewer than three, or where they differ by more
/// than a tenth of the range: then nothing rests.
float contact_level(std::span<const float> truth, std::size_t pixels);

}  // namespace supertac
