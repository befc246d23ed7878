#include "data/map/surface_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "io/numbers/numbers.h"
#include "io/numbers/same_bits.h"
#include "io/numbers/text.h"

namespace supertac {
namespace {

constexpr double kStandingMm = 1e-3, kLeastError = 0.01;
constexpr double kMemory = 0.25, kJump = 0.5;  // shares of the side
constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

// A value between pixels: the sum over t = 0..3 of weight[t] * pixel[n + first + t].
struct Taps {
  int first;
  std::array<double, 4> weight;
};

// Both for a place `at` pixels behind pixel n, -1 < at < 1.
Taps cubic(double at) {
  const double f = at < 0 ? 1 + at : at;
  return {at < 0 ? -2 : -1,
          {f * (-0.5 + f * (1 - 0.5 * f)), 1 + f * f * (-2.5 + 1.5 * f), f * (0.5 + f * (2 - 1.5 * f)),
           f * f * (-0.5 + 0.5 * f)}};
}

Taps linear(double at) {
  const double f = at < 0 ? 1 + at : at;
  return {at < 0 ? -2 : -1, {0, 1 - f, f, 0}};
}

// [m][n] = picture at (m, n), moved by the taps; pixels beyond an edge are as the edge.
std::vector<double> interpolated(std::span<const float> picture, const ImageGrid& grid, const Taps& x,
                                 const Taps& y) {
  const int height = grid.height, width = grid.width;
  std::vector<double> rows(grid.pixels()), out(grid.pixels());
  const auto clamped = [](int i, int count) { return static_cast<std::size_t>(std::clamp(i, 0, count - 1)); };
  const auto row_of = [width](auto&& values, std::size_t r) {
    return values.data() + r * static_cast<std::size_t>(width);
  };
  for (int r = 0; r < height; ++r) {
    const float* from = row_of(picture, static_cast<std::size_t>(r));
    double* to = row_of(rows, static_cast<std::size_t>(r));
    for (int n = 0; n < width; ++n)
      for (int t = 0; t < 4; ++t)
        to[n] += x.weight[static_cast<std::size_t>(t)] * double{from[clamped(n + x.first + t, width)]};
  }
  for (int m = 0; m < height; ++m) {
    double* to = row_of(out, static_cast<std::size_t>(m));
    for (int t = 0; t < 4; ++t) {
      const double* from = row_of(rows, clamped(m + y.first + t, height));
      const double weight = y.weight[static_cast<std::size_t>(t)];
      for (int n = 0; n < width; ++n) to[n] += weight * from[n];
    }
  }
  return out;
}

// The cells under a picture along one side: as many as it has pixels, from `first` on, their centres `at`
// pixels behind those of the picture's pixels.
struct Place {
  std::int64_t first;
  double at;
};

Place place_of(double centre_mm, double pixel_mm, int pixels) {
  const double pixel_0 = centre_mm / pixel_mm - 0.5 * pixels;  // as a number of cells
  const double first = std::ceil(pixel_0 - 0.5);
  return {static_cast<std::int64_t>(first), first - pixel_0};
}

}  // namespace

bool MapRegion::holds(const MapRegion& o) const {
  return o.empty() || (o.left >= left && o.bottom >= bottom && o.left + o.width <= left + width &&
                       o.bottom + o.height <= bottom + height);
}

MapRegion MapRegion::with(const MapRegion& o) const {
  if (empty() || o.empty()) return empty() ? o : *this;
  const std::int64_t l = std::min(left, o.left), b = std::min(bottom, o.bottom);
  return {l, b, std::max(left + width, o.left + o.width) - l,
          std::max(bottom + height, o.bottom + o.height) - b};
}

SurfaceMap::SurfaceMap(const ImageGrid& grid, bool grows)
    : grid_(grid),
      grows_(grows),
      side_mm_(std::sqrt(grid.width_mm() * grid.height_mm())),
      most_growth_(same_bits::exp(1 / kMemory)) {}

// The way since the picture before; a jump ends all visits.
double SurfaceMap::step(double x_mm, double y_mm) {
  const double dx = x_mm - x_mm_, dy = y_mm - y_mm_, way = std::sqrt(dx * dx + dy * dy);
  const bool jumped = pictures_ == 0 || way > kJump * side_mm_;
  number_ += jumped ? 2 : 1;
  ++pictures_;
  x_mm_ = x_mm, y_mm_ = y_mm;
  return jumped ? 0 : way;
}

void SurfaceMap::make_room(const MapRegion& region) {
  if (stored_.holds(region)) return;
  MapRegion wanted = stored_.with(region);
  if (!stored_.empty()) {  // room to go on in the same direction: what is added doubles
    const std::int64_t wider = wanted.width - stored_.width, higher = wanted.height - stored_.height;
    if (wanted.left < stored_.left) wanted.left -= stored_.width / 2;
    if (wanted.bottom < stored_.bottom) wanted.bottom -= stored_.height / 2;
    if (wider > 0) wanted.width += stored_.width / 2;
    if (higher > 0) wanted.height += stored_.height / 2;
  }
  if (wanted.width > kMostCells / wanted.height)
    throw std::runtime_error("map: the places lie too far apart: " + std::to_string(wanted.width) + " x " +
                             std::to_string(wanted.height) + " cells of " + grid_.pixel_mm.text() +
                             " mm, at most " + std::to_string(kMostCells) +
                             " are kept; are positions in mm?");
  std::vector<Cell> cells(static_cast<std::size_t>(wanted.width * wanted.height));
  for (std::int64_t j = 0; j < stored_.height; ++j)
    std::copy_n(
        cells_.begin() + j * stored_.width, stored_.width,
        cells.begin() + (stored_.bottom + j - wanted.bottom) * wanted.width + stored_.left - wanted.left);
  cells_ = std::move(cells);
  stored_ = wanted;
}

void SurfaceMap::add(double x_mm, double y_mm, std::span<const float> picture,
                     std::span<const float> errors) {
  if (!std::isfinite(x_mm) || !std::isfinite(y_mm)) return;
  expect_values("map", "picture", grid_.pixels(), picture.size());
  const bool with_errors = pictures_ > 0 ? has_errors_ : !errors.empty();  // all pictures or none
  expect_values("map", "errors", with_errors ? picture.size() : 0, errors.size());
  constexpr double kFarthest = 1e15;  // whole numbers are exact below
  const Pitch pixel = grid_.pixel_mm;
  if (std::abs(x_mm) > kFarthest * pixel.x || std::abs(y_mm) > kFarthest * pixel.y)
    throw std::runtime_error(refusal("map", "position", "mm", format(x_mm) + ", " + format(y_mm)));
  const Place x = place_of(x_mm, pixel.x, grid_.width), y = place_of(y_mm, pixel.y, grid_.height);
  const MapRegion covered = {x.first, y.first, grid_.width, grid_.height};
  make_room(covered);
  newest_ = covered, felt_ = felt_.with(covered), has_errors_ = !errors.empty();
  const double way = step(x_mm, y_mm), counts = std::min(way, std::min(pixel.x, pixel.y)) + kStandingMm;
  const double growth = grows_ ? same_bits::exp(way / (kMemory * side_mm_)) : 1;
  const std::vector<double> values = interpolated(picture, grid_, cubic(x.at), cubic(y.at)),
                            off = has_errors_ ? interpolated(errors, grid_, linear(x.at), linear(y.at))
                                              : std::vector<double>{};
  for (std::int64_t m = 0; m < grid_.height; ++m) {
    Cell* cell = &cells_[index(x.first, y.first + m)];
    const std::size_t row = static_cast<std::size_t>(m * grid_.width);
    for (std::size_t n = row; n < row + static_cast<std::size_t>(grid_.width); ++n, ++cell) {
      cell->growth = cell->seen + 1 == number_ ? std::min(growth * cell->growth, most_growth_) : 1;
      cell->seen = number_;
      const double error = has_errors_ ? std::max(off[n], kLeastError) : 1;
      const double weight = counts * cell->growth / error;
      cell->weight += weight;
      cell->value += weight * values[n];
      cell->error += weight * error;
    }
  }
}

const SurfaceMap::Cell* SurfaceMap::felt_cell(std::int64_t i, std::int64_t j) const {
  if (!stored_.holds({i, j, 1, 1})) return nullptr;
  const Cell& cell = cells_[index(i, j)];
  return cell.weight > 0 ? &cell : nullptr;
}

void SurfaceMap::read(double x_mm, double y_mm, std::span<float> picture) const {
  const double left = x_mm / grid_.pixel_mm.x - 0.5 * grid_.width,
               bottom = y_mm / grid_.pixel_mm.y - 0.5 * grid_.height;  // of pixel (0, 0), in cells
  const double i0 = std::floor(left), j0 = std::floor(bottom);
  const auto sum = [&](std::int64_t i, std::int64_t j, const Taps& x, const Taps& y) {
    double value = 0, weight = 0;
    bool whole = true;
    for (int r = 0; r < 4; ++r) {
      for (int c = 0; c < 4; ++c) {
        const double w = x.weight[static_cast<std::size_t>(c)] * y.weight[static_cast<std::size_t>(r)];
        const Cell* cell = felt_cell(i + x.first + c, j + y.first + r);
        whole = whole && cell != nullptr;
        if (cell != nullptr) value += w * cell->value / cell->weight, weight += w;
      }
    }
    return std::pair(whole, value / weight);
  };
  for (int r = 0; r < grid_.height; ++r) {
    for (int c = 0; c < grid_.width; ++c) {
      const std::int64_t i = static_cast<std::int64_t>(i0) + c, j = static_cast<std::int64_t>(j0) + r;
      auto [whole, value] = sum(i, j, cubic(left - i0), cubic(bottom - j0));
      if (!whole) value = sum(i, j, linear(left - i0), linear(bottom - j0)).second;
      picture[static_cast<std::size_t>(r * grid_.width + c)] = static_cast<float>(value);
    }
  }
}

MapCells SurfaceMap::cells(const MapRegion& region) const {
  MapCells cells{.region = region, .values = {}, .errors = {}};
  for (std::int64_t j = region.bottom; j < region.bottom + region.height; ++j) {
    for (std::int64_t i = region.left; i < region.left + region.width; ++i) {
      const Cell* cell = felt_cell(i, j);
      cells.values.push_back(cell != nullptr ? static_cast<float>(cell->value / cell->weight) : kNone);
      if (has_errors_)
        cells.errors.push_back(cell != nullptr ? static_cast<float>(cell->error / cell->weight) : kNone);
    }
  }
  return cells;
}

}  // namespace supertac
