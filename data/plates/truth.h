#pragma once

#include <span>

#include "data/plates/plate.h"
#include "data/plates/taxel_array.h"

namespace supertac {

/// Height scaled to [0,1] by the plate: (z - min_height) / (max_height - min_height), which is z / h for
/// ridges, bumps and blobs, (z + h) / 2h for waves, and 0 everywhere on a plain plate.
double truth_value(const Plate& plate, double x_mm, double y_mm);

/// The plate under the finger as an image [height][width] of truth_value at the centres of its pixels:
///   image[r * width + c] at x = x_mm - width p / 2 + (c + 1/2) p, y = y_mm - height p / 2 + (r + 1/2) p
/// with p = pixel_mm. Row r grows with y, column c with x; (x_mm, y_mm) is the finger's centre on the plate.
/// Throws std::invalid_argument when a side is below 1 or image does not hold height * width elements.
void truth_image(const Plate& plate, double x_mm, double y_mm, const ImageGrid& grid, std::span<float> image);

/// A frame is in contact when its truth has a pixel above 0.
bool in_contact(std::span<const float> truth);

}  // namespace supertac
