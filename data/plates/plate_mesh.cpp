// Plates as solids.

#include <algorithm>
#include <cmath>
#include <utility>

#include "data/plates/stl.h"

namespace supertac {
namespace {

constexpr double kStepMm = HeightMap::kCellMm;
constexpr double kSliverMm = 1e-3;  // lines, and heights, closer than this are one

using Vertex = std::array<float, 3>;

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

// The top's points, row by row; xs and ys ascend.
struct Top {
  std::vector<double> xs, ys;
  std::vector<Vertex> points;
  const Vertex& at(std::size_t row, std::size_t column) const { return points[row * xs.size() + column]; }
};

// Surfaces that were read count as uniform_in_x() within more than a solid may be off.
bool is_same_along_x(const Plate& plate, const std::vector<double>& xs, const std::vector<double>& ys) {
  return std::ranges::all_of(ys, [&](double y) {
    return std::ranges::all_of(
        xs, [&](double x) { return std::abs(plate.height(x, y) - plate.height(0, y)) <= kSliverMm; });
  });
}

Top top_of(const Plate& plate) {
  Top top;
  top.xs = lattice(0, rig::kPlateWidthMm);
  top.ys = lines_along_y(plate);
  if (is_same_along_x(plate, top.xs, top.ys)) top.xs = {0, rig::kPlateWidthMm};
  for (const double y : top.ys)
    for (const double x : top.xs)
      top.points.push_back(
          {static_cast<float>(x), static_cast<float>(y), static_cast<float>(plate.height(x, y))});
  return top;
}

// The top's outline, counter-clockwise seen from above, each point once.
std::vector<Vertex> outline_of(const Top& top) {
  const std::size_t last_row = top.ys.size() - 1, last_column = top.xs.size() - 1;
  std::vector<Vertex> outline;
  for (std::size_t c = 0; c < last_column; ++c) outline.push_back(top.at(0, c));
  for (std::size_t r = 0; r < last_row; ++r) outline.push_back(top.at(r, last_column));
  for (std::size_t c = last_column; c > 0; --c) outline.push_back(top.at(last_row, c));
  for (std::size_t r = last_row; r > 0; --r) outline.push_back(top.at(r, 0));
  return outline;
}

}  // namespace

std::vector<Triangle> mesh_of(const Plate& plate) {
  const Top top = top_of(plate);
  const auto bottom = static_cast<float>(plate.min_height() - kSolidBaseMm);
  std::vector<Triangle> solid;
  const auto add_quad = [&](const Vertex& a, const Vertex& b, const Vertex& c, const Vertex& d) {
    solid.push_back({a, b, c});
    solid.push_back({a, c, d});
  };
  for (std::size_t r = 0; r + 1 < top.ys.size(); ++r)
    for (std::size_t c = 0; c + 1 < top.xs.size(); ++c)
      add_quad(top.at(r, c), top.at(r, c + 1), top.at(r + 1, c + 1), top.at(r + 1, c));
  const auto outline = outline_of(top);
  const Vertex centre = {static_cast<float>(rig::kPlateWidthMm / 2),
                         static_cast<float>(rig::kPlateLengthMm / 2), bottom};
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Vertex &a = outline[i], &b = outline[(i + 1) % outline.size()];
    const Vertex below_a = {a[0], a[1], bottom}, below_b = {b[0], b[1], bottom};
    add_quad(a, below_a, below_b, b);
    solid.push_back({centre, below_b, below_a});
  }
  return solid;
}

}  // namespace supertac
