#pragma once

#include <span>

#include "data/plate.h"

namespace supertac {

constexpr double kWindowMm = 12;  ///< side of the square seen by the finger: 4 taxels at 3 mm pitch

/// Height scaled to [0,1] by the plate: (z - min_height) / (max_height - min_height), which is z / h for
/// ridges, bumps and blobs, (z + h) / 2h for waves, and 0 everywhere on a plain plate.
double truth_value(const Plate& plate, double x_mm, double y_mm);

/// The plate under the finger as an image [size][size] of truth_value at the centres of its pixels:
///   image[r * size + c] at x = x_mm - 6 + (c + 1/2) p, y = y_mm - 6 + (r + 1/2) p, p = 12 mm / size.
/// Row r grows with y, column c with x; (x_mm, y_mm) is the finger's centre on the plate.
/// @throws std::invalid_argument when size < 1 or image does not hold size * size elements.
void truth_image(const Plate& plate, double x_mm, double y_mm, int size, std::span<float> image);

}  // namespace supertac
