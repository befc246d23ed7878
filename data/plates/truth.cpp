#include "data/plates/truth.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>
#include <vector>

#include "io/numbers/median.h"
#include "io/numbers/text.h"

namespace supertac {

double truth_value(const Plate& plate, double x_mm, double y_mm) {
  const double scale = std::max(plate.max_height(), -plate.min_height());
  return scale > 0 ? plate.height(x_mm, y_mm) / scale : 0.0;
}

void truth_image(const Plate& plate, double x_mm, double y_mm, const ImageGrid& grid,
                 std::span<float> image) {
  if (grid.height < 1 || grid.width < 1)
    throw std::invalid_argument(refusal("truth_image", "grid", "1x1 pixels or more", grid.text()));
  expect_values("truth_image", "image", grid.pixels(), image.size());
  const bool uniform = plate.uniform_in_x();  // then a row has one height
  const auto width = static_cast<std::size_t>(grid.width);
  for (int r = 0; r < grid.height; ++r) {
    const double y = y_mm - grid.height_mm() / 2 + (r + 0.5) * grid.pixel_mm.y;
    const std::span<float> row = image.subspan(static_cast<std::size_t>(r) * width, width);
    if (uniform) {
      std::fill(row.begin(), row.end(), static_cast<float>(truth_value(plate, x_mm, y)));
      continue;
    }
    for (int c = 0; c < grid.width; ++c) {
      const double x = x_mm - grid.width_mm() / 2 + (c + 0.5) * grid.pixel_mm.x;
      row[static_cast<std::size_t>(c)] = static_cast<float>(truth_value(plate, x, y));
    }
  }
}

Zone zone_of(const Plate& plate, double x_mm, double y_mm, const ImageGrid& grid) {
  constexpr double kAroundMm = 3;
  const auto pixels = [](double pixel_mm) { return static_cast<int>(std::lround(kAroundMm / pixel_mm)); };
  const ImageGrid larger{grid.height + 2 * pixels(grid.pixel_mm.y), grid.width + 2 * pixels(grid.pixel_mm.x),
                         grid.pixel_mm};
  std::vector<float> image(larger.pixels());
  truth_image(plate, x_mm, y_mm, larger, image);
  if (!in_contact(image)) return Zone::flat;
  image.resize(grid.pixels());
  truth_image(plate, x_mm, y_mm, grid, image);
  return in_contact(image) ? Zone::contact : Zone::near;
}

bool in_contact(std::span<const float> truth, float level) {
  return std::any_of(truth.begin(), truth.end(), [&](float v) { return level > 0 ? v > level : v != 0; });
}

float contact_level(std::span<const float> truth, std::size_t pixels) {
  constexpr double kSigmas = 6, kMost = 0.1, kSigmasOf95 = 1.645;
  constexpr std::size_t kShare = 10, kLeastFrames = 3, kMostFrames = 200;
  const std::size_t frames = truth.size() / pixels;
  std::vector<double> sums(frames);
  for (std::size_t i = 0; i < frames * pixels; ++i) sums[i / pixels] += double{truth[i]};
  std::vector<std::size_t> quiet(frames);
  std::iota(quiet.begin(), quiet.end(), std::size_t{0});
  std::ranges::stable_sort(quiet, {}, [&](std::size_t f) { return sums[f]; });
  quiet.resize(std::min(frames / kShare, kMostFrames));
  if (quiet.size() < kLeastFrames) return 0;
  std::vector<double> values;
  for (const std::size_t f : quiet)
    for (const float v : truth.subspan(f * pixels, pixels)) values.push_back(double{v});
  const double rest = median(values);
  const double noise = kSigmas * (quantile(values, 0.95) - rest) / kSigmasOf95;
  return noise <= kMost ? static_cast<float>(rest + noise) : 0;
}

}  // namespace supertac
