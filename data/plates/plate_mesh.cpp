// Plates as solids.

#include <algorithm>
#include <cmath>
#include <utility>

#include "data/plates/stl.h"

namespace supertac {
namespace {

constexpr double kStepMm = HeightMap::kCellMm;
constexpr double kSliverMm = 1e-3;  // lines, and heights, closer than this are one

// These lines, low and high, and the multiples of the step between, none of them slivers.
std::vector<double> lattice(double low, double high, std::vector<double> lines = {}) {
  lines.insert(lines.end(), {low, high});
  for (auto i = std::ceil(low / kStepMm); i * kStepMm < high; ++i) lines.push_back(i * kStepMm);
  std::ranges::sort(lines);
  const auto slivers = std::ranges::unique(lines, [](double a, double b) { return b - a <= kSliverMm; });
  lines.erase(slivers.begin(), slivers.end());
  return lines;
}

std::vector<double> lines_along_y(const Plate& plate) {
  std::vector<double> lines = plate.crests();
  lines.insert(lines.end(), {0, rig::kPlateLengthMm});
  const double begin = std::max(0.0, plate.texture_begin());
  return lattice(begin, std::max(begin, plate.texture_end()), std::move(lines));
}

// Surfaces that were read count as uniform_in_x() within more than a solid may be off.
bool is_same_along_x(const Plate& plate, const std::vector<double>& xs, const std::vector<double>& ys) {
  return std::ranges::all_of(ys, [&](double y) {
    return std::ranges::all_of(
        xs, [&](double x) { return std::abs(plate.height(x, y) - plate.height(0, y)) <= kSliverMm; });
  });
}

// Of a surface, counter-clockwise seen from above, each point once.
std::vector<Vertex> outline_of(const std::vector<Vertex>& points, std::size_t columns) {
  const std::size_t last_row = points.size() / columns - 1, last_column = columns - 1;
  const auto at = [&](std::size_t row, std::size_t column) { return points[row * columns + column]; };
  std::vector<Vertex> outline;
  for (std::size_t c = 0; c < last_column; ++c) outline.push_back(at(0, c));
  for (std::size_t r = 0; r < last_row; ++r) outline.push_back(at(r, last_column));
  for (std::size_t c = last_column; c > 0; --c) outline.push_back(at(last_row, c));
  for (std::size_t r = last_row; r > 0; --r) outline.push_back(at(r, 0));
  return outline;
}

}  // namespace

std::vector<Triangle> solid_under(const std::vector<Vertex>& points, std::size_t columns, float bottom) {
  std::vector<Triangle> solid;
  const auto add_quad = [&](const Vertex& a, const Vertex& b, const Vertex& c, const Vertex& d) {
    solid.push_back({a, b, c});
    solid.push_back({a, c, d});
  };
  for (std::size_t p = columns; p < points.size(); ++p)
    if (p % columns != 0) add_quad(points[p - columns - 1], points[p - columns], points[p], points[p - 1]);
  const std::vector<Vertex> outline = outline_of(points, columns);
  const Vertex &first = points.front(), &last = points.back();
  const Vertex centre = {(first[0] + last[0]) / 2, (first[1] + last[1]) / 2, bottom};
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Vertex &a = outline[i], &b = outline[(i + 1) % outline.size()];
    const Vertex below_a = {a[0], a[1], bottom}, below_b = {b[0], b[1], bottom};
    add_quad(a, below_a, below_b, b);
    solid.push_back({centre, below_b, below_a});
  }
  return solid;
}

std::vector<Triangle> mesh_of(const Plate& plate) {
  std::vector<double> xs = lattice(0, rig::kPlateWidthMm);
  const std::vector<double> ys = lines_along_y(plate);
  if (is_same_along_x(plate, xs, ys)) xs = {0, rig::kPlateWidthMm};
  std::vector<Vertex> points;
  for (const double y : ys)
    for (const double x : xs)
      points.push_back(
          {static_cast<float>(x), static_cast<float>(y), static_cast<float>(plate.height(x, y))});
  return solid_under(points, xs.size(), static_cast<float>(plate.min_height() - kSolidBaseMm));
}

}  // namespace supertac
