#include "data/truth.h"

#include <stdexcept>
#include <string>

namespace supertac {

double truth_value(const Plate& plate, double x_mm, double y_mm) {
  const double range = plate.max_height() - plate.min_height();
  return range > 0 ? (plate.height(x_mm, y_mm) - plate.min_height()) / range : 0.0;
}

void truth_image(const Plate& plate, double x_mm, double y_mm, int size, std::span<float> image) {
  if (size < 1 || image.size() != static_cast<size_t>(size) * static_cast<size_t>(size))
    throw std::invalid_argument("truth_image: size " + std::to_string(size) +
                                " needs an image of size * size pixels, got " + std::to_string(image.size()));
  const double pixel = kWindowMm / size;
  size_t i = 0;
  for (int r = 0; r < size; ++r) {
    const double y = y_mm - kWindowMm / 2 + (r + 0.5) * pixel;
    for (int c = 0; c < size; ++c) {
      const double x = x_mm - kWindowMm / 2 + (c + 0.5) * pixel;
      image[i++] = static_cast<float>(truth_value(plate, x, y));
    }
  }
}

}  // namespace supertac
