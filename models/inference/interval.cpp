#include "models/inference/interval.h"

namespace supertac {

double doubt_of(std::span<const float> picture, std::span<const float> predicted_error,
                const ImageGrid& grid) {
  constexpr double kC = 0.005;
  const int side = std::min({7, grid.height, grid.width});
  const double pixels = side * side;
  double kept = 0;
  int squares = 0;
  for (int top = 0; top + side <= grid.height; ++top) {
    for (int left = 0; left + side <= grid.width; ++left, ++squares) {
      double sum = 0, sum_of_squares = 0, errors = 0;
      for (int row = top; row < top + side; ++row) {
        for (int column = left; column < left + side; ++column) {
          const auto i = static_cast<std::size_t>(row * grid.width + column);
          const double p = picture[i], s = at_least(predicted_error[i]);
          sum += p, sum_of_squares += p * p, errors += s * s;
        }
      }
      const double variance = std::max(0.0, (sum_of_squares - sum * sum / pixels) / pixels);
      kept += (2 * variance + kC) / (2 * variance + errors / pixels + kC);
    }
  }
  return 1 - kept / squares;
}

}  // namespace supertac
